"""Many cars in one call: each row is what a single environment would be."""

from __future__ import annotations

from functools import cache

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import hprs
from hprs.envs import task_of
from hprs.errors import UsageError

from .driven import FOLLOW, IDS, SAFE, assert_observed, driven

ROWS = 3
HORIZON = 12
MODES = list(AutoresetMode)


def make(name, mode=AutoresetMode.NEXT_STEP, **options):
    return gym.make_vec(name, ROWS, autoreset_mode=mode, **options)


@cache
def shared(name, mode=AutoresetMode.NEXT_STEP):
    return make(name, mode, max_episode_steps=HORIZON)


def actions(steps, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform([0.2, -0.3], [1, 0.3], (steps, ROWS, 2)).astype(np.float32)


@pytest.mark.parametrize("name", IDS)
def test_a_row_is_the_pure_functions(name):
    envs = make(name)
    played = [driven(name, seed) for seed in range(5, 5 + ROWS)]
    observations, infos = envs.reset(seed=5)
    steps = min(len(row) for row, _ in played)
    assert steps > 30
    for number in range(1, steps + 1):
        together = np.stack([row[number - 1] for row, _ in played])
        observations, rewards, terminated, truncated, infos = envs.step(together)
        for row, (_, answers) in enumerate(played):
            expected = answers[number]
            assert_observed(observations[row], expected[0])
            signals = {key: infos["signals"][key][row] for key in expected[1]}
            assert signals == pytest.approx(expected[1], abs=1e-5)
            assert rewards[row] == pytest.approx(expected[2], rel=1e-5, abs=1e-5)
            assert (terminated[row], truncated[row]) == (expected[3], expected[4])


def same(ours, theirs, path="infos"):
    """Infos are equal where their masks say that there is anything."""
    assert {k for k in ours if not k.startswith("_")} == {k for k in theirs if not k.startswith("_")}, path  # fmt: skip
    for key, value in theirs.items():
        if key.startswith("_"):
            np.testing.assert_array_equal(ours[key], value, f"{path}.{key}")
        elif isinstance(value, dict):
            same(ours[key], value, f"{path}.{key}")
        else:
            for row in np.flatnonzero(theirs[f"_{key}"]):
                np.testing.assert_allclose(ours[key][row], value[row], atol=1e-5, err_msg=path)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_it_behaves_as_gymnasiums_vector_of_single_environments(mode):
    ours = shared(SAFE, mode)
    theirs = SyncVectorEnv(
        [lambda: gym.make(SAFE, max_episode_steps=HORIZON)] * ROWS, autoreset_mode=mode
    )
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    first, second = ours.reset(seed=7), theirs.reset(seed=7)
    np.testing.assert_allclose(first[0], second[0], atol=1e-5)
    same(first[1], second[1])
    ends = 0
    for action in actions(2 * HORIZON + 6):
        one, other = ours.step(action), theirs.step(action)
        for mine, yours in zip(one[:4], other[:4], strict=True):
            np.testing.assert_allclose(mine, yours, atol=1e-4)
            assert mine.dtype == yours.dtype
        same(one[4], other[4])
        done = one[2] | one[3]
        ends += done.sum()
        if mode == AutoresetMode.DISABLED and done.any():
            options = {"reset_mask": done}
            one, other = (envs.reset(options=dict(options)) for envs in (ours, theirs))
            np.testing.assert_allclose(one[0], other[0], atol=1e-5)
            same(one[1], other[1])
    assert ends >= 2 * ROWS


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("name", IDS)
def test_a_task_goes_on_top(name, mode):
    envs = hprs.wrap_vector(shared(name, mode), task_of(name))
    singles = []
    for row in range(ROWS):
        env = hprs.wrap(gym.make(name, max_episode_steps=HORIZON), task_of(name))
        env.reset(seed=3 + row)
        singles.append(env)
    envs.reset(seed=3)
    finished = np.zeros(ROWS, bool)
    for action in actions(HORIZON):
        _, rewards, terminated, truncated, infos = envs.step(action)
        for row in np.flatnonzero(~finished):
            _, reward, *ended, info = singles[row].step(action[row])
            assert rewards[row] == pytest.approx(reward, abs=1e-4)
            assert [terminated[row], truncated[row]] == ended
            if any(ended):
                final = infos.get("final_info", infos)
                assert final["assessment"][row].requirements == pytest.approx(
                    info["assessment"].requirements, abs=1e-5
                )
        finished |= terminated | truncated
    assert finished.all()


def test_what_it_returns_is_the_callers_own():
    envs = shared(SAFE)
    first, infos = envs.reset(seed=1)
    kept = first.copy(), infos["signals"]["progress"].copy()
    second = envs.step(actions(1)[0])
    np.testing.assert_array_equal(first, kept[0])
    np.testing.assert_array_equal(infos["signals"]["progress"], kept[1])
    kept = second[0].copy()
    second[0][:] = 0
    second[4]["signals"]["speed"][:] = 9
    third = envs.step(actions(1)[0])
    assert not np.array_equal(third[0], kept)
    assert (third[4]["signals"]["speed"] < 9).all()


def test_row_seeds_may_be_given_and_rows_without_one_go_on():
    envs = shared(SAFE)
    listed, _ = envs.reset(seed=[4, 5, 6])
    counted, _ = envs.reset(seed=4)
    np.testing.assert_array_equal(listed, counted)
    mixed, _ = envs.reset(seed=[4, None, 6])
    assert np.array_equal(mixed[[0, 2]], counted[[0, 2]])
    assert not np.array_equal(mixed[1], counted[1])


def test_many_rows_are_reset_in_several_calls():
    envs = gym.make_vec(SAFE, 70)
    observations, _ = envs.reset(seed=0)
    assert len(np.unique(observations, axis=0)) == 70
    again, _ = envs.reset(seed=0)
    np.testing.assert_array_equal(observations, again)


def test_both_tracks_are_driven():
    envs = gym.make_vec(SAFE, 70)
    envs.reset(seed=0)
    assert 20 < np.asarray(envs._episodes.track).sum() < 50


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros((ROWS, 3)), r"Actions have shape \(3, 2\)"),
        (np.zeros(2), r"not \(2,\)"),
        (np.array([[0, 0], [0, np.nan], [0, 0]]), "The action of row 1 is not finite"),
    ],
)
def test_bad_actions_are_refused(action, message):
    envs = shared(SAFE)
    envs.reset(seed=0)
    with pytest.raises(UsageError, match=message):
        envs.step(action)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"autoreset_mode": "later"}, "autoreset_mode is one of"),
        (
            {"max_episode_steps": 0},
            r"^max_episode_steps needs a whole number from 1 to 1,000,000, got 0",
        ),
        ({"horizon": 9}, "There is no option 'horizon' here. Use max_episode_steps."),
        ({"trakcs": "gm"}, "There is no option 'trakcs'. Did you mean 'tracks'"),
        ({"cars": 2}, "There is no option 'cars'"),
    ],
)
def test_bad_options_are_refused(options, message):
    with pytest.raises(UsageError, match=message):
        gym.make_vec(FOLLOW, 2, **options)


def test_bad_numbers_of_rows_are_refused():
    with pytest.raises(UsageError, match="num_envs is a whole number from 1 on, not 0"):
        gym.make_vec(SAFE, 0)


def test_misuse_is_refused():
    envs = make(SAFE, AutoresetMode.DISABLED, max_episode_steps=1)
    with pytest.raises(UsageError, match=r"step\(\) was called before reset"):
        envs.step(np.zeros((ROWS, 2)))
    some = np.array([True, False, False])
    with pytest.raises(UsageError, match="first reset must be of all rows"):
        envs.reset(options={"reset_mask": some})
    with pytest.raises(UsageError, match="3 seeds are needed, got 2"):
        envs.reset(seed=[1, 2])
    envs.reset(seed=0)
    for mask in (~some[:2], np.zeros(3, bool), [1, 0, 0]):
        with pytest.raises(UsageError, match="reset_mask is 3 bools"):
            envs.reset(options={"reset_mask": mask})
    envs.step(np.zeros((ROWS, 2)))
    with pytest.raises(UsageError, match="The episode of row 0 has ended"):
        envs.step(np.zeros((ROWS, 2)))
