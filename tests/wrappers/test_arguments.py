"""What both wrappers ask of what they are given."""

from __future__ import annotations

import warnings

import gymnasium as gym
import pytest
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import FrameStackObservation, NormalizeObservation
from gymnasium.wrappers.vector import NormalizeObservation as NormalizeObservations

import hprs
from hprs.errors import UsageError
from hprs.rewards import Hierarchical
from hprs.wrappers.single import wrap
from hprs.wrappers.vector import wrap_vector
from tests.probes import Slider, slider_task

TASK = hprs.parse_task("signal x = obs[0] in [-3, 3]\nconquer here: x <= 0")


def test_unknown_rewards_and_a_missing_discount_are_refused():
    with pytest.raises(UsageError, match=r"unknown reward 'hrps'.*Did you mean 'hprs'"):
        wrap(Slider(), slider_task(), reward="hrps")
    with pytest.raises(UsageError, match="needs the learner's discount"):
        wrap(Slider(), slider_task(), end="invariant")


@pytest.mark.parametrize(
    ("wrapper", "env", "message"),
    [
        (wrap, "CartPole-v1", r"an environment is needed here, got 'CartPole-v1'.*gymnasium.make"),
        (wrap, "vector", "wrap takes one environment, got .*; use hprs.wrap_vector"),
        (wrap_vector, "single", "wrap_vector takes a vector environment, got .*; use hprs.wrap"),
        (wrap_vector, None, r"an environment is needed here, got None.*gymnasium.make_vec"),
    ],
)
def test_what_is_no_environment_is_refused(wrapper, env, message):
    made = {"single": Slider(), "vector": gym.vector.SyncVectorEnv([Slider])}
    with pytest.raises(UsageError, match=message):
        wrapper(made.get(env, env), slider_task())


def test_what_is_no_reward_is_refused():
    with pytest.raises(UsageError, match=r"a reward is a name .*hprs.* or has `init` and `step`"):
        wrap(Slider(), slider_task(), reward=3)


def test_a_reward_object_is_accepted():
    task = slider_task()
    assert wrap(Slider(), task, reward=Hierarchical(task, end="released"))


@pytest.mark.parametrize("wrapper", [wrap, wrap_vector])
@pytest.mark.parametrize("given", [{"end": "invariant"}, {"end": "paper"}, {"discount": 0.9}])
def test_a_convention_or_a_discount_beside_a_reward_object_is_refused(wrapper, given):
    env = Slider() if wrapper is wrap else SyncVectorEnv([Slider])
    (name,) = given
    with pytest.raises(UsageError, match=f"{name}=.* has no effect on a reward .* as an object"):
        wrapper(env, TASK, Hierarchical(TASK, end="released"), **given)


@pytest.mark.parametrize("wrapper", [wrap, wrap_vector])
def test_signals_that_are_no_function_are_refused(wrapper):
    env = Slider() if wrapper is wrap else SyncVectorEnv([Slider])
    with pytest.raises(UsageError, match=r"`signals` must be a function .*, got 3"):
        wrapper(env, TASK, signals=3)


def test_a_task_of_another_kind_is_refused_by_the_wrapper_itself():
    """As after a spec's way through JSON, which turns tasks into dictionaries."""
    arguments = wrap(Slider(), TASK)._saved_kwargs
    with pytest.raises(UsageError, match="task"):
        hprs.wrappers.single.TaskWrapper(Slider(), **{**arguments, "task": {"signals": []}})


@pytest.mark.parametrize(
    "make",
    [
        lambda: wrap(NormalizeObservation(Slider()), TASK),
        lambda: wrap_vector(NormalizeObservations(SyncVectorEnv([Slider])), TASK),
        lambda: wrap_vector(SyncVectorEnv([lambda: NormalizeObservation(Slider())] * 2), TASK),
        lambda: wrap_vector(
            SyncVectorEnv([lambda: gym.Wrapper(NormalizeObservation(Slider()))]), TASK
        ),
    ],
)
def test_normalised_observations_below_the_task_warn_once_where_it_is_wrapped(make):
    with pytest.warns(UserWarning, match="NormalizeObservation lies below the task") as caught:
        make()
    assert [warning.filename for warning in caught] == [__file__]


def test_wrapping_sub_environments_first_and_normalising_them_afterwards_is_silent():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wrap_vector(SyncVectorEnv([Slider]), TASK)
        FrameStackObservation(wrap(Slider(), TASK), 2)
