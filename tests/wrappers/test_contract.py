"""Gymnasium's contract: `check_env`, and environments made from their spec."""

from __future__ import annotations

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import hprs
from hprs.rewards import Hierarchical
from hprs.wrappers.single import TaskWrapper, wrap
from tests.probes import Slider, slider_task

TASK = hprs.parse_task(
    "signal x = obs[0] in [-4.8, 4.8]\nsignal angle = obs[2] in [-0.42, 0.42]\n"
    "ensure near: abs(x) <= 0.1\nencourage upright: abs(angle) <= 0.05"
)


def spin(observation, action, last_action, info):
    return {"spin": observation[3]}


def played(env) -> list:
    rng = np.random.default_rng(0)
    observation, info = env.reset(seed=4)
    found = [(observation.tolist(), 0.0, False, info)]
    while not found[-1][2]:
        observation, reward, terminated, _, info = env.step(int(rng.integers(2)))
        found.append((observation.tolist(), reward, terminated, info))
    return found


def checked(env) -> set[str]:
    """What `check_env` warns of."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(env, skip_render_check=True)
    return {str(warning.message).replace(str(env), "") for warning in caught}


@pytest.mark.parametrize(
    ("bare", "task"), [(Slider, slider_task()), (lambda: gym.make("CartPole-v1"), TASK)]
)
def test_check_env_passes_and_warns_of_nothing_but_what_it_says_of_any_wrapper(bare, task):
    assert checked(wrap(bare(), task)) == checked(gym.wrappers.ClipReward(bare(), -9, 9))


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"reward": "sparse", "end_on_violation": False, "end_on_target": False},
        {"reward": Hierarchical(TASK, end="invariant", discount=0.9)},
        {"end": "released"},
    ],
)
def test_an_environment_made_from_the_spec_is_equal(arguments):
    env = wrap(gym.make("CartPole-v1", max_episode_steps=40), TASK, **arguments)
    again = gym.make(env.spec)
    assert isinstance(again, TaskWrapper)
    assert (again.task, again.reward, again.spec) == (env.task, env.reward, env.spec)
    if arguments.get("end_on_violation", True):
        assert played(again) == played(env)


def test_signal_functions_and_wrappers_on_top_are_made_from_the_spec_too():
    task = hprs.parse_task("signal spin in [-4, 4]\nensure slow: abs(spin) <= 0.4")
    env = gym.wrappers.RecordEpisodeStatistics(wrap(gym.make("CartPole-v1"), task, signals=spin))
    again = gym.make(env.spec)
    again.env.reset(seed=1)
    assert again.env.step(0)[1:4] == (env.env.reset(seed=1), env.env.step(0))[1][1:4]


def test_what_a_signal_function_belongs_to_need_not_be_copyable():
    class Locked:
        def __deepcopy__(self, memo):
            raise TypeError("there is one of me")

        def spin(self, observation, action, last_action, info):
            return {"spin": observation[3]}

    task = hprs.parse_task("signal spin in [-4, 4]\nensure slow: abs(spin) <= 0.4")
    assert wrap(gym.make("CartPole-v1"), task, signals=Locked().spin)
