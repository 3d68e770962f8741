"""What both wrappers ask of what they are given."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
from gymnasium import wrappers as gym_wrappers

from hprs.errors import UsageError
from hprs.rewards.base import Reward
from hprs.rewards.registry import REWARDS, make_reward
from hprs.rewards.shaping import DEFAULT_END, End
from hprs.spec.misuse import shown
from hprs.spec.task import Task, require_task

_CHANGES_OBSERVATIONS = (
    gym_wrappers.NormalizeObservation,
    gym_wrappers.FrameStackObservation,
    gym_wrappers.RescaleObservation,
    gym_wrappers.vector.NormalizeObservation,
    gym_wrappers.vector.RescaleObservation,
)
"""Gymnasium's wrappers below which `obs[...]` would no longer be in the task's units."""


def require_environment(value: object, *, vector: bool) -> None:
    """Refuse what is no environment of the wrapper's kind.

    Raises:
        UsageError: It is something else; the message says what to call.
    """
    single, many = isinstance(value, gym.Env), isinstance(value, gym.vector.VectorEnv)
    if many if vector else single:
        return
    if single:
        raise UsageError(f"wrap_vector takes a vector environment, got {value}; use hprs.wrap.")
    if many:
        raise UsageError(f"wrap takes one environment, got {value}; use hprs.wrap_vector.")
    make = "gymnasium.make_vec(id, copies)" if vector else "gymnasium.make(id)"
    raise UsageError(f"an environment is needed here, got {shown(value)}. Make one with {make}.")


def chosen_reward(
    reward: str | Reward,
    task: Task,
    environment: Any,
    *,
    end: End | None,
    discount: float | None,
    options: Mapping[str, Any] | None,
) -> Reward:
    """A reward given by name or as an object.

    Raises:
        UsageError: It is neither, or an object with a convention, a discount or options beside it,
            or the task is none.
    """
    require_task(task)
    if isinstance(reward, str):
        end = DEFAULT_END if end is None else end
        horizon = horizon_of(environment)
        return make_reward(
            reward, task, end=end, discount=discount, horizon=horizon, **(options or {})
        )
    given: Any = reward
    if not (callable(getattr(given, "init", None)) and callable(getattr(given, "step", None))):
        raise UsageError(
            f"a reward is a name ({', '.join(REWARDS)}) or has `init` and `step`, "
            f"got {shown(reward)}."
        )
    for name, value in (("end", end), ("discount", discount), ("reward_options", options)):
        if value is not None:
            raise UsageError(
                f"{name}={value!r} has no effect on a reward that is given as an object; give it "
                "to the reward, as in hprs.rewards.Hierarchical(task, end=..., discount=...)."
            )
    return reward


def horizon_of(environment: Any) -> int | None:
    """Steps after which an environment is registered to truncate episodes, if it is.

    Of a vector environment made by hand, those of its first sub-environment.
    """
    spec = environment.spec
    if spec is None and isinstance(environment.unwrapped, gym.vector.SyncVectorEnv):
        spec = environment.unwrapped.envs[0].spec
    return None if spec is None else spec.max_episode_steps


def warn_of_changed_observations(*environments: Any) -> None:
    """Warn of Gymnasium's own wrappers on any of these that change what `obs[...]` means."""
    found: dict[str, None] = {}
    for environment in environments:
        layer: Any = environment
        while hasattr(layer, "env"):
            kind: Any = type(layer)
            if issubclass(kind, _CHANGES_OBSERVATIONS):
                found[kind.__name__] = None
            layer = layer.env
    for name in found:
        warnings.warn(
            f"{name} lies below the task: its signals read changed observations. "
            "Wrap with the task first, then normalise or stack.",
            stacklevel=4,
        )
