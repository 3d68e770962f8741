"""Policies: functions from an observation to an action."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import gymnasium as gym

from hprs.errors import UsageError
from hprs.wrappers.signals import zero_action


class Policy(Protocol):
    """Maps an observation to an action."""

    def __call__(self, observation: Any, /) -> Any:
        """The action to take."""
        ...


@runtime_checkable
class BatchedPolicy(Protocol):
    """A policy without memory that answers many observations at once, which is faster."""

    def __call__(self, observation: Any, /) -> Any:
        """The action to take."""
        ...

    def batch(self, observations: Sequence[Any]) -> Sequence[Any]:
        """One action for each observation."""
        ...


@dataclass(frozen=True)
class ConstantPolicy:
    """Always the same action."""

    action: Any

    def __call__(self, observation: Any, /) -> Any:
        """The action."""
        return deepcopy(self.action)

    def batch(self, observations: Sequence[Any]) -> Sequence[Any]:
        """The action, for each observation."""
        return [deepcopy(self.action) for _ in observations]


class RandomPolicy:
    """Actions drawn from the action space.

    Args:
        space: The action space.
        seed: Seed of the draws.
    """

    def __init__(self, space: gym.Space[Any], seed: int) -> None:
        self._space = deepcopy(space)
        self._space.seed(seed)

    def __call__(self, observation: Any, /) -> Any:
        """The next draw."""
        return self._space.sample()


def do_nothing(space: gym.Space[Any]) -> ConstantPolicy:
    """The policy of zero actions, clipped to the space.

    Raises:
        UsageError: The space is made of several spaces and has no zero.
    """
    action = zero_action(space)
    if action is None:
        raise UsageError(f"there is no zero action in a {type(space).__name__} space.")
    return ConstantPolicy(action)


def import_policy(name: str) -> Callable[[Any], Any]:
    """The function or object named by `module:function`.

    Raises:
        UsageError: There is no such module or function.
    """
    module, _, attribute = name.partition(":")
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, "")
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise UsageError(f"policy '{name}': there is no module '{error.name}'.") from None
    policy = vars(found).get(attribute)
    if not callable(policy):
        raise UsageError(f"policy '{name}': module '{module}' has no function '{attribute}'.")
    return policy
