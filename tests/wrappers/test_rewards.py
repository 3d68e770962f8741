"""Every reward inside Gymnasium's single and vector environments and Stable-Baselines3.

A single environment pays what the definition says of its episodes, and everything else pays what
single environments do.
"""

from __future__ import annotations

from copy import deepcopy
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv

import hprs
from hprs.errors import SignalError, UsageError
from hprs.rewards import EpisodeRobustness, Reward, WindowRobustness
from hprs.wrappers.single import wrap
from hprs.wrappers.vector import wrap_vector
from tests.probes import Slider, slider_task
from tests.rewards.episodes import VARIANTS, expected, variant

COUNT, STEPS = 3, 40
KINDS = ("achieve", "conquer")
POLE = hprs.parse_task("signal x = obs[0] in [-4.8, 4.8]\nensure near: abs(x) <= 2.4")


def actions() -> np.ndarray:
    return np.random.default_rng(1).uniform(-1, 1, (STEPS, COUNT, 1))


class Spy:
    """A reward that writes down the signals of the running episode."""

    def __init__(self, reward: Reward) -> None:
        self._reward = reward
        self.trace: list[dict[str, Any]] = []

    def init(self, signals: Any) -> Any:
        self.trace = [dict(signals)]
        return self._reward.init(signals)

    def step(self, memory: Any, signals: Any, terminated: Any, truncated: Any) -> Any:
        self.trace.append(dict(signals))
        return self._reward.step(memory, signals, terminated, truncated)


@cache
def played(name: str, kind: str) -> list[list[Any]]:
    """For each single environment its steps: reward, terminated, truncated."""
    task = slider_task(kind)
    found = []
    for index in range(COUNT):
        spy = Spy(variant(name, task))
        env = wrap(Slider(), task, spy)
        env.reset(seed=index)
        steps: list[Any] = []
        episode: list[Any] = []
        for action in actions()[:, index]:
            _, reward, terminated, truncated, _ = env.step(action)
            episode.append((reward, terminated, truncated))
            if terminated or truncated:
                check(name, kind, spy, [reward for reward, _, _ in episode])
                steps, episode = steps + episode, []
                env.reset()
        found.append(steps + episode)
    return found


def check(name: str, kind: str, spy: Spy, rewards: list[Any]) -> None:
    task = slider_task(kind)
    names = [*(signal.name for signal in task.signals), "env_reward"]
    trace = {k: np.array([s.get(k) or 0.0 for s in spy.trace]) for k in names}
    np.testing.assert_allclose(rewards, expected(name, task, trace), atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", VARIANTS)
def test_a_single_environment_pays_what_the_definition_says(name, kind):
    ends = [step for steps in played(name, kind) for step in steps if step[1] or step[2]]
    assert len(ends) > COUNT
    assert any(truncated for _, _, truncated in ends)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", VARIANTS)
def test_vector_environments_pay_the_same_in_every_autoreset_mode(name, kind, mode):
    task = slider_task(kind)
    bare = SyncVectorEnv([Slider] * COUNT, autoreset_mode=mode)
    envs = wrap_vector(bare, task, variant(name, task))
    envs.reset(seed=0)
    wanted = played(name, kind)
    at, resetting = [0] * COUNT, np.zeros(COUNT, bool)
    while min(at) < STEPS // 2:
        chosen = np.stack([actions()[min(at[i], STEPS - 1), i] for i in range(COUNT)])
        _, rewards, terminated, truncated, _ = envs.step(chosen)
        done = terminated | truncated
        for i in np.flatnonzero(~resetting):
            if at[i] < STEPS:
                reward, *ends = wanted[i][at[i]]
                np.testing.assert_allclose(rewards[i], reward, atol=1e-12)
                assert [terminated[i], truncated[i]] == ends
            at[i] += 1
        assert not rewards[resetting].any()
        if mode == AutoresetMode.NEXT_STEP:
            resetting = done
        elif mode == AutoresetMode.DISABLED and done.any():
            envs.reset(options={"reset_mask": done})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", [name for name in VARIANTS if not name.startswith("vector")])
def test_stable_baselines3_is_paid_the_same(name, kind):
    from stable_baselines3.common.vec_env import DummyVecEnv

    task = slider_task(kind)
    envs = DummyVecEnv([lambda: wrap(Slider(), task, variant(name, task))] * COUNT)
    envs.seed(0)
    envs.reset()
    for number, action in enumerate(actions()[: STEPS // 2]):
        _, rewards, done, _ = envs.step(action)
        for i in range(COUNT):
            reward, terminated, truncated = played(name, kind)[i][number]
            assert rewards[i] == pytest.approx(reward, abs=1e-6)
            assert done[i] == (terminated or truncated)


def test_stable_baselines3_in_other_processes_is_paid_the_same():
    from stable_baselines3.common.vec_env import SubprocVecEnv

    # One a process, since a process takes seconds to start; each has a memory of another make.
    chosen = [("hprs", "conquer"), ("bhnr", "conquer"), ("pam", "achieve")]

    def making(name, kind):
        return lambda: wrap(Slider(), slider_task(kind), variant(name, slider_task(kind)))

    envs = SubprocVecEnv([making(*one) for one in chosen], start_method="spawn")
    try:
        envs.seed(0)
        envs.reset()
        ends = np.zeros(COUNT, int)
        for number, action in enumerate(actions()):
            _, rewards, done, _ = envs.step(action)
            for i, one in enumerate(chosen):
                reward, terminated, truncated = played(*one)[i][number]
                assert rewards[i] == pytest.approx(reward, abs=1e-6)
                assert done[i] == (terminated or truncated)
            ends += done
        assert (ends > 1).all()
    finally:
        envs.close()


def test_the_window_of_bhnr_comes_from_the_registered_horizon():
    window = WindowRobustness(POLE, 25)
    assert wrap(gym.make("CartPole-v1"), POLE, "bhnr").reward == window
    short = wrap(gym.make("CartPole-v1", max_episode_steps=60), POLE, "bhnr")
    assert short.reward == WindowRobustness(POLE, 3)
    made = [
        gym.make_vec("CartPole-v1", 2, vectorization_mode="sync"),
        gym.make_vec("CartPole-v1", 2, vectorization_mode="vector_entry_point"),
        SyncVectorEnv([lambda: gym.make("CartPole-v1")] * 2),
    ]
    assert [wrap_vector(envs, POLE, "bhnr").reward for envs in made] == [window] * 3
    with pytest.raises(
        UsageError, match=r"needs the option window: .* horizon .* is not known here"
    ):
        wrap(Slider(), slider_task(), "bhnr")
    with pytest.raises(UsageError, match="at most the horizon of 500 steps, got 501"):
        wrap(gym.make("CartPole-v1"), POLE, "bhnr", reward_options={"window": 501})
    given = wrap(Slider(), slider_task(), "bhnr", reward_options={"window": 3})
    assert given.reward == WindowRobustness(slider_task(), 3)


def test_the_horizon_of_environments_in_other_processes_is_not_known():
    envs = AsyncVectorEnv([lambda: gym.make("CartPole-v1")] * 2, context="spawn")
    try:
        with pytest.raises(
            UsageError, match=r"needs the option window: .* horizon .* is not known here"
        ):
            wrap_vector(envs, POLE, "bhnr")
        given = wrap_vector(envs, POLE, "bhnr", reward_options={"window": 25})
        assert given.reward == WindowRobustness(POLE, 25)
    finally:
        envs.close()


def test_options_beside_a_reward_object_are_an_error():
    with pytest.raises(UsageError, match=r"reward_options=\{'margins': 'raw'\} has no effect"):
        wrap(
            Slider(),
            slider_task(),
            EpisodeRobustness(slider_task()),
            reward_options={"margins": "raw"},
        )


def test_a_vector_of_rewards_is_announced_as_in_mo_gymnasium():
    task = slider_task()
    env = wrap(Slider(), task, "vector")
    assert env.reward_space.shape == (4,)
    assert env.unwrapped.reward_space == env.get_wrapper_attr("reward_space")
    env.reset(seed=0)
    reward = env.step(np.zeros(1))[1]
    assert env.reward_space.contains(reward)
    envs = wrap_vector(SyncVectorEnv([Slider] * 2), task, "vector")
    assert (envs.reward_dim, envs.reward_space.shape) == (4, (4,))
    envs.reset(seed=0)
    assert envs.step(np.zeros((2, 1)))[1].shape == (2, 4)
    assert not hasattr(wrap(Slider(), task, "tltl").unwrapped, "reward_space")


ENVIRONMENTS = [(Slider, wrap), (lambda: SyncVectorEnv([Slider] * 2), wrap_vector)]


@pytest.mark.parametrize(("make", "put"), ENVIRONMENTS)
def test_an_environment_announces_what_its_newest_wrapper_pays(make, put):
    bare, task = make(), slider_task()
    put(bare, task, "vector")
    assert (bare.reward_dim, bare.reward_space.shape) == (4, (4,))
    put(bare, hprs.parse_task("signal x = obs[0] in [-3, 3]\nensure a: x <= 2"), "vector")
    assert (bare.reward_dim, bare.reward_space.shape) == (1, (1,))
    for reward in ("hprs", "env"):
        put(bare, task, reward)
        assert not hasattr(bare, "reward_space") and not hasattr(bare, "reward_dim")


@pytest.mark.parametrize(("make", "put"), ENVIRONMENTS)
def test_closing_takes_off_an_environment_what_was_announced_on_it(make, put):
    bare, task = make(), slider_task()
    older, newer = (put(bare, task, "vector") for _ in range(2))
    older.close()
    assert bare.reward_space is newer.reward_space
    newer.close()
    assert not hasattr(bare, "reward_space") and not hasattr(bare, "reward_dim")
    newer.close()
    # Below other wrappers, too.
    outer = put(make(), task, "vector")
    wrapper = gym.vector.VectorWrapper if put is wrap_vector else gym.Wrapper
    wrapper(outer).close()
    assert not hasattr(outer.unwrapped, "reward_space")


@pytest.mark.parametrize(("make", "put"), ENVIRONMENTS)
@pytest.mark.parametrize("source", ["obs[7]", "info.absent"])
def test_nothing_is_announced_of_what_cannot_be_wrapped(make, put, source):
    bare = make()
    with pytest.raises(SignalError):
        put(bare, hprs.parse_task(f"signal x = {source} in [0, 1]\nensure a: x <= 1"), "vector")
    assert not hasattr(bare, "reward_space")


def test_a_copy_of_an_environment_announces_for_itself():
    env = wrap(Slider(), slider_task(), "vector")
    copy = deepcopy(env)
    assert copy.unwrapped.reward_space is copy.reward_space
    copy.close()
    assert not hasattr(copy.unwrapped, "reward_space")
    assert env.unwrapped.reward_space is env.reward_space


def test_a_reward_space_of_an_environment_s_own_stays():
    bare = Slider()
    bare.reward_space = gym.spaces.Box(-1.0, 0.0, (1,))
    own = bare.reward_space
    wrap(bare, slider_task(), "hprs").close()
    assert bare.reward_space is own
