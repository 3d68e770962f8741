"""Policies: functions from an observation to an action."""

from __future__ import annotations

import importlib
import sys
import traceback
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from hprs.errors import PolicyError, UsageError, did_you_mean
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


@dataclass(frozen=True)
class ForeignPolicy:
    """A user's function, whose actions are checked; those outside a `Box` are clipped to it."""

    name: str
    """How the user calls it."""
    function: Callable[[Any], Any]
    space: gym.Space[Any]
    """The action space."""

    def __call__(self, observation: Any, /) -> Any:
        """The action to take.

        Raises:
            PolicyError: The function fails, or its action is not one of the space.
        """
        try:
            action = self.function(observation)
        except Exception as error:
            raise PolicyError(f"policy '{self.name}' fails: {_place(error)}") from error
        found = _as_action(action, self.space)
        if found is None:
            raise PolicyError(
                f"policy '{self.name}' returned {_brief(action)}, which is no action of "
                f"{_brief(self.space)}."
            )
        return found


def import_policy(name: str, space: gym.Space[Any]) -> ForeignPolicy:
    """The function or object named by `module:function`.

    Args:
        name: Module and function.
        space: The action space of the environment.

    Raises:
        UsageError: There is no such module or function.
        PolicyError: The module fails while it is imported.
    """
    module, _, attribute = name.partition(":")
    if not all(part.isidentifier() for part in module.split(".")):
        raise UsageError(f"policy '{name}': '{module}' is not a module's name.")
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, "")
    try:
        found = importlib.import_module(module)
    except Exception as error:
        if isinstance(error, ModuleNotFoundError):
            raise UsageError(f"policy '{name}': there is no module '{error.name}'.") from None
        raise PolicyError(
            f"policy '{name}': module '{module}' cannot be imported: {_place(error)}"
        ) from error
    policy = vars(found).get(attribute)
    if not callable(policy):
        raise UsageError(f"policy '{name}': module '{module}' has no function '{attribute}'.")
    return ForeignPolicy(name, policy, space)


def named_policy(name: str, environment: gym.Env[Any, Any]) -> Policy:
    """A policy as users name it.

    Args:
        name: `zero`, `random`, a .zip of Stable-Baselines3, or `module:function`.
        environment: Where it shall act.

    Raises:
        UsageError: There is no such policy.
        PolicyError: It cannot be imported, or was trained with other spaces.
    """
    space = environment.action_space
    if name == "zero":
        return do_nothing(space)
    if name == "random":
        return RandomPolicy(space, seed=0)
    if name.endswith(".zip"):
        from hprs.training.sb3 import load_zip

        policy = load_zip(Path(name))
        check_spaces(name, policy.spaces, environment)
        return policy
    if ":" in name:
        return import_policy(name, space)
    raise UsageError(
        f"unknown policy '{name}'; it is zero, random, a .zip of Stable-Baselines3, or "
        f"module:function.{did_you_mean(name, ('zero', 'random'))}"
    )


def check_spaces(
    name: str, trained: Sequence[gym.Space[Any]], environment: gym.Env[Any, Any]
) -> None:
    """See that a policy fits an environment; bounds may differ, shapes and choices may not.

    Args:
        name: How the user calls the policy.
        trained: The observation and action space that it was trained with.
        environment: Where it shall act.

    Raises:
        PolicyError: It was trained with other spaces.
    """
    here = environment.observation_space, environment.action_space
    for word, own, other in zip(("observations", "actions"), trained, here, strict=True):
        if not _is_alike(own, other):
            raise PolicyError(
                f"policy '{name}' was trained with {word} of {_brief(own)}; this environment has "
                f"{_brief(other)}."
            )


def _is_alike(one: gym.Space[Any], other: gym.Space[Any]) -> bool:
    if isinstance(one, spaces.Dict) and isinstance(other, spaces.Dict):
        return one.keys() == other.keys() and all(_is_alike(one[key], other[key]) for key in one)
    if isinstance(one, spaces.Box) and isinstance(other, spaces.Box):
        return one.shape == other.shape
    return one == other


def _as_action(action: Any, space: gym.Space[Any]) -> Any:
    """An action as the space has it; None if it is no action."""
    if isinstance(space, spaces.Box):
        try:
            numbers = np.asarray(action, dtype=space.dtype)
        except (TypeError, ValueError, OverflowError):
            return None
        if numbers.shape != space.shape or np.isnan(numbers).any():
            return None
        return np.asarray(np.clip(numbers, space.low, space.high))
    if isinstance(action, np.ndarray) and isinstance(space, spaces.Discrete) and action.size == 1:
        action = action.reshape(())[()]
    return action if space.contains(action) else None


def _place(error: Exception) -> str:
    """What went wrong in a user's code, and where."""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({Path(frames[-1].filename).name}, line {frames[-1].lineno})" if frames else ""
    if isinstance(error, SyntaxError):
        return f"{error}"
    return f"{type(error).__name__}: {error}{where}"


def _brief(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."
