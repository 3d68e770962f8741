"""What both wrappers ask of what they are given."""

from __future__ import annotations

from typing import Any

import gymnasium as gym

from hprs.errors import UsageError
from hprs.rewards.base import Reward
from hprs.rewards.hierarchical import End
from hprs.rewards.registry import REWARDS, make_reward
from hprs.spec.misuse import shown
from hprs.spec.task import Task, require_task


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


def chosen_reward(reward: str | Reward, task: Task, *, end: End, discount: float | None) -> Reward:
    """A reward given by name or as an object.

    Raises:
        UsageError: It is neither, or the task is none.
    """
    require_task(task)
    if isinstance(reward, str):
        return make_reward(reward, task, end=end, discount=discount)
    given: Any = reward
    if not (callable(getattr(given, "init", None)) and callable(getattr(given, "step", None))):
        raise UsageError(
            f"a reward is a name ({', '.join(REWARDS)}) or has `init` and `step`, "
            f"got {shown(reward)}."
        )
    return reward
