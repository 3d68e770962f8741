"""The driving environments: their contract, their episodes and their options."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

import hprs
from hprs.carsim.actuators import MAX_SPEED_COMMAND
from hprs.envs import BENCHMARKS, task_of
from hprs.errors import TrackError, UsageError
from hprs.training.environment import make_environment
from hprs.training.episode_log import EpisodeLog, EpisodeState

from .driven import (
    FOLLOW,
    IDS,
    SAFE,
    assert_observed,
    driven,
    key_of,
    pilot,
    reset,
    shared,
    simulation_of,
    step,
)

FULL = np.array([1.0, 0.0], np.float32)


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("seed", [0, 3, *range(100, 110)])
def test_an_environment_is_its_pure_functions(name, seed):
    env = shared(name)
    actions, answers = driven(name, seed)
    assert len(actions) > 30
    observation, info = env.reset(seed=seed)
    assert_observed(observation, answers[0][0])
    for number, action in enumerate(actions, 1):
        observation, reward, terminated, truncated, info = env.step(action)
        expected = answers[number]
        assert_observed(observation, expected[0])
        assert info["signals"] == pytest.approx(expected[1], abs=1e-5)
        assert reward == pytest.approx(expected[2], rel=1e-5, abs=1e-5)
        assert (terminated, truncated) == (expected[3], False)


@pytest.mark.parametrize("name", IDS)
def test_a_running_episode_comes_back_bit_for_bit_in_another_environment(name):
    env, other = (EpisodeLog(make_environment(name, task_of(name))) for _ in range(2))
    env.reset(seed=5)
    rng = np.random.default_rng(0)
    actions = rng.uniform([-0.5, -0.3], [1, 0.3], (60, 2)).astype(np.float32)
    for action in actions:
        if any(env.step(action)[2:4]):
            env.reset()
    env.reset()
    for action in actions[:7]:
        env.step(action)
    state = env.state()
    assert not state.lost
    assert other.replay(EpisodeState(actions=state.actions, **state.to_json())) == ""
    for action in actions[7:12]:
        ours, theirs = env.step(action), other.step(action)
        assert np.array_equal(ours[0], theirs[0])
        assert ours[1:4] == theirs[1:4]
        assert ours[4]["signals"] == theirs[4]["signals"]
    assert np.array_equal(env.reset()[0], other.reset()[0])


@pytest.mark.parametrize("name", IDS)
def test_the_reset_observation_fills_the_history(name):
    env = shared(name)
    observation, info = env.reset(seed=2)
    stacked = env.simulation.stacked
    assert observation[:6].tolist() == [0, -1] * 3
    scans = observation[6 : 6 + 64 * stacked].reshape(stacked, 64)
    assert (scans == scans[0]).all()
    assert (scans > -1).all()
    assert len(set(observation[6 + 64 * stacked :].tolist())) == 1
    assert info["signals"]["progress"] == info["signals"]["collision"] == 0
    assert info["signals"]["speed_command"] == info["signals"]["last_speed_command"] == -1


@pytest.mark.parametrize("name", IDS)
def test_observations_are_stacked_from_the_oldest_to_the_newest(name):
    env = shared(name)
    seen = [env.reset(seed=2)[0]] + [env.step(np.array([1, 0.1], np.float32))[0] for _ in range(3)]
    stacked = env.simulation.stacked
    newest = [o[6 : 6 + 64 * stacked].reshape(stacked, 64)[-1] for o in seen]
    last = seen[-1][6 : 6 + 64 * stacked].reshape(stacked, 64)
    # Not to the bit: the same reading is computed anew wherever it is used.
    np.testing.assert_allclose(last, newest[-stacked:], atol=1e-6)
    np.testing.assert_array_equal(seen[-1][-stacked:], [o[-1] for o in seen[-stacked:]])
    speeds = -1 + 2 * 0.4 / MAX_SPEED_COMMAND * np.arange(1, 4)
    commands = np.stack([np.full(3, 0.1), speeds], axis=1)
    np.testing.assert_allclose(seen[-1][:6].reshape(3, 2), commands, atol=1e-6)


def test_an_action_of_one_adds_four_tenths_of_a_metre_per_second_up_to_the_limit():
    # Commands are obeyed at a wall as well, so that where the car is does not matter.
    env = shared(SAFE)
    env.reset(seed=0)
    commands = []
    for _ in range(12):
        signals = env.step(FULL)[4]["signals"]
        commands.append((signals["speed_command"] + 1) / 2 * MAX_SPEED_COMMAND)
        assert signals["steering"] == 0
    np.testing.assert_allclose(commands, np.minimum(0.4 * np.arange(1, 13), 3.5), atol=1e-6)
    # Actions are clipped, and the command never leaves its range.
    assert env.step(np.array([-9.0, 9.0]))[4]["signals"]["steering"] == 1
    signals = env.step(np.array([-9.0, -9.0]))[4]["signals"]
    assert (signals["steering"], signals["last_steering"]) == (-1, 1)
    assert signals["speed_command"] == pytest.approx(-1 + 2 * 2.7 / 3.5, abs=1e-6)
    assert signals["last_speed_command"] == pytest.approx(-1 + 2 * 3.1 / 3.5, abs=1e-6)


@pytest.mark.parametrize("name", IDS)
def test_the_own_reward_is_a_hundred_times_the_progress(name):
    _, answers = driven(name, 0)
    progress = [answer[1]["progress"] for answer in answers]
    rewards = [answer[2] for answer in answers[1:]]
    np.testing.assert_allclose(rewards, 100 * np.diff(progress), atol=2e-4)
    assert sum(rewards) == pytest.approx(100 * progress[-1], abs=1e-2)
    assert progress[-1] > 0.2


def test_a_lap_ends_the_episode_and_meets_the_task():
    actions, answers = driven(SAFE, 0, 1000)
    env = hprs.wrap(gym.make(SAFE, max_episode_steps=1000), task_of(SAFE))
    env.reset(seed=0)
    for action in actions:
        _, _, terminated, _, info = env.step(action)
    assert answers[-1][1]["progress"] >= 1 > answers[-2][1]["progress"]
    assert terminated
    assert (info["assessment"].safe, info["assessment"].target) == (True, True)


@pytest.mark.parametrize("name", IDS)
def test_a_wall_ends_the_episode_and_violates_the_task(name):
    env = hprs.wrap(gym.make(name), task_of(name))
    env.reset(seed=1)
    terminated = False
    while not terminated:
        _, _, terminated, truncated, info = env.step(np.array([1.0, 1.0], np.float32))
        assert not truncated
    assert info["signals"]["collision"] == 1
    assert info["margins"]["no_collision"] == -0.5
    assert not info["assessment"].safe
    assert env.reset()[1]["signals"]["collision"] == 0


def test_a_standing_car_is_left_to_the_time_limit_and_left_behind_by_its_leader():
    env = gym.make(FOLLOW)
    env.reset(seed=0)
    assert env.spec.max_episode_steps == BENCHMARKS[FOLLOW].horizon
    distances = [env.step(np.zeros(2, np.float32))[4]["signals"]["lead_distance"] for _ in range(9)]
    assert (np.diff(distances) <= 0).all()
    assert distances[-1] < distances[0] - 0.1


def test_the_leader_starts_a_metre_ahead_on_the_grid():
    env = gym.make(FOLLOW, start="grid").unwrapped
    signals = env.reset(seed=0)[1]["signals"]
    assert signals["lead_distance"] == pytest.approx(-1.0, abs=0.02)
    assert signals["leader_contact"] == 0


def test_coming_close_to_the_leader_violates_the_distance_and_touching_it_ends_the_episode():
    simulation = simulation_of(FOLLOW)
    episode, _, signals = reset(simulation, key_of(0))
    terminated, margins = False, []
    while not terminated:
        action = pilot(simulation, episode)
        action[0] = np.clip((2.6 - 1.75 * (signals["speed_command"] + 1)) / 0.4, -1, 1)
        episode, _, signals, _, terminated, _ = step(simulation, episode, action)
        task_signals = {name: float(value) for name, value in signals.items()}
        margins.append(task_of(FOLLOW).margins(task_signals))
    assert signals["leader_contact"] == 1
    assert signals["collision"] == 0
    assert margins[0]["keep_distance"] > 0
    assert margins[-1]["keep_distance"] < 0 < margins[-1]["no_collision"]
    assert -0.75 < signals["lead_distance"] < 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tracks": "gn"}, "No track is called 'gn'"),
        ({"tracks": []}, "tracks is a name or a list of names"),
        ({"tracks": 3}, "tracks is a name or a list of names"),
        ({"tracks": "random:x"}, "needs a whole number as its seed"),
        ({"start": "grod"}, "start is one of random, grid, not 'grod'. Did you mean 'grid'?"),
        ({"start": []}, "start is one of random, grid"),
        ({"randomisation": "some"}, "There are no ranges 'some'"),
        ({"randomisation": 1}, "randomisation is True, False or a name"),
        ({"beams": 0}, "beams needs a whole number from 1 to 1,000,000, got 0"),
        ({"beams": 6.5}, "beams needs a whole number"),
        ({"stacked": True}, "stacked needs a whole number"),
        ({"reverse": "yes"}, "reverse needs true or false, got 'yes'"),
        ({"render_mode": "ansi"}, "render_mode is rgb_array or None, not 'ansi'"),
        ({"camera": "folloe"}, "camera is fixed or follow, not 'folloe'. Did you mean 'follow'?"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render:UserWarning")
def test_a_bad_option_is_one_clear_error(options, message):
    with pytest.raises(UsageError) as caught:
        gym.make(SAFE, **options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [0, -1.0, 20, True, "far", float("nan")])
def test_a_bad_gap_threshold_is_refused(value):
    with pytest.raises(UsageError, match=r"gap_threshold needs a (distance|number)"):
        gym.make(FOLLOW, gap_threshold=value)


def test_a_missing_map_file_is_refused():
    with pytest.raises(TrackError, match="no_such_map"):
        gym.make(SAFE, tracks="no_such_map.yaml")


@pytest.mark.parametrize(
    "action", [[np.nan, 0], [0, np.inf], [0.0], [0.0, 0.0, 0.0], [[0.0, 0.0]], 0.5]
)
def test_a_bad_action_is_refused(action):
    env = shared(SAFE)
    env.reset(seed=0)
    with pytest.raises(UsageError, match="two finite numbers"):
        env.step(np.array(action, np.float32))


def test_stepping_before_the_first_reset_is_refused():
    with pytest.raises(UsageError, match=r"step\(\) was called before reset"):
        gym.make(SAFE).unwrapped.step(FULL)


def test_other_lidars_look_the_same_way():
    few, all_of_them = gym.make(SAFE, beams=8, reach=4).unwrapped, shared(SAFE)
    seen = few.reset(seed=4)[0][6:14]
    # Beam 0 and the last one are the same; noise is 3 %.
    ends = all_of_them.reset(seed=4)[0][[6, 69]]
    np.testing.assert_allclose(seen[[0, 7]] + 1, np.minimum(ends + 1, 2 * 4 / 15), rtol=0.07)
    assert 2 * 4 * 0.97 / 15 - 1 <= seen.max() <= 2 * 4 / 15 - 1
    assert few.observation_space.shape == (6 + 8 + 1,)
    assert few.step(FULL)[0].shape == (15,)


def test_copies_go_their_own_way():
    env = gym.make(SAFE).unwrapped
    env.reset(seed=0)
    env.step(FULL)
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        before = copy.deepcopy(twin)
        assert np.array_equal(before.step(FULL)[0], twin.step(FULL)[0])
    assert np.array_equal(env.step(FULL)[0], before.step(FULL)[0]) is False


def without_jax(code):
    return subprocess.run(
        [sys.executable, "-c", f"import sys\nsys.modules['jax'] = None\n{code}"],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    "code",
    [
        f"gymnasium.make('{SAFE}')",
        f"gymnasium.make_vec('{FOLLOW}', 2)",
        "import hprs.envs.functional",
    ],
)
def test_a_missing_jax_names_the_extra(code):
    found = without_jax(f"import gymnasium, hprs.envs\n{code}")
    assert found.stderr.strip().splitlines()[-1] == (
        "hprs.errors.MissingExtraError: JAX is not installed. "
        "Install it with: pip install 'hprs[jax]'"
    )


def test_tasks_are_listed_and_read_without_jax():
    found = without_jax(
        "import hprs, hprs.envs\n"
        "print(*(task for b in hprs.envs.BENCHMARKS.values() for task in b.task.labels))"
    )
    assert found.stderr == ""
    assert "keep_distance" in found.stdout
