"""Rewards by name: the one place that knows which exist."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.base import Reward
from hprs.rewards.environment import environment_reward
from hprs.rewards.hierarchical import DEFAULT_END, End, Hierarchical, check_convention
from hprs.rewards.sparse import sparse
from hprs.spec.task import Task, require_task

Factory = Callable[[Task, End, float | None], Reward]

REWARDS: Mapping[str, Factory] = MappingProxyType(
    {
        "hprs": Hierarchical,
        "sparse": lambda task, end, discount: sparse(task),
        "env": lambda task, end, discount: environment_reward(task),
    }
)
"""Name to a function of task, end-of-episode convention and discount."""


def make_reward(
    name: str, task: Task, *, end: End = DEFAULT_END, discount: float | None = None
) -> Reward:
    """A reward by name.

    Args:
        name: One of `REWARDS`.
        task: The task it is derived from.
        end: End-of-episode convention of potential-based rewards; see `Hierarchical`.
        discount: The learner's discount; `end="invariant"` needs it.

    Raises:
        UsageError: The name or the convention is unknown, the discount is missing, or what is
            given as the task is none.
    """
    if name not in tuple(REWARDS):
        raise UsageError(
            f"unknown reward '{name}'; choose one of {', '.join(REWARDS)}."
            f"{did_you_mean(str(name), REWARDS)}"
        )
    check_convention(end, discount)
    return REWARDS[name](require_task(task), end, discount)
