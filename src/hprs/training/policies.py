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

from hprs.deploy import Bundle, ChoiceLayout, load_bundle
from hprs.errors import PolicyError, UsageError, did_you_mean
from hprs.training.onnx_policy import ONNX_SUFFIX, OnnxPolicy
from hprs.wrappers.signals import zero_action

BUNDLE_SUFFIX = ".bundle"
"""How the name of a bundle's file ends."""


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

    def batch(self, observations: Sequence[Any]) -> Any:
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


def floors(space: gym.Space[Any]) -> dict[str, Policy]:
    """What any policy should beat: doing nothing, where there is a zero, and random actions."""
    random = {"random": RandomPolicy(space, seed=0)}
    return random if zero_action(space) is None else {"doing nothing": do_nothing(space), **random}


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
        name: `zero`, `random`, a bundle (`.bundle`), a .zip of Stable-Baselines3, an ONNX file, or
            `module:function`.
        environment: Where it shall act.

    Raises:
        UsageError: There is no such policy.
        PolicyError: It cannot be imported, or was trained with other spaces.
        BundleError: The bundle is damaged.
    """
    space = environment.action_space
    if name == "zero":
        return do_nothing(space)
    if name == "random":
        return RandomPolicy(space, seed=0)
    if name.endswith(BUNDLE_SUFFIX):
        bundle = load_bundle(name)
        check_fits(name, bundle, environment)
        return bundle
    if name.endswith(".zip"):
        from hprs.training.sb3 import load_zip

        policy = load_zip(Path(name))
        check_fits(name, policy, environment)
        return policy
    if name.endswith(ONNX_SUFFIX):
        return OnnxPolicy(name, environment)
    if ":" in name:
        return import_policy(name, space)
    raise UsageError(
        f"unknown policy '{name}'; it is zero, random, a {BUNDLE_SUFFIX} file, a .zip of "
        f"Stable-Baselines3, an {ONNX_SUFFIX} file, or module:function.{did_you_mean(name, ('zero', 'random'))}"
    )


def check_fits(name: str, policy: Policy, environment: gym.Env[Any, Any]) -> None:
    """See that a trained policy fits an environment: shapes and choices, not bounds.

    Args:
        name: How the user calls the policy.
        policy: A bundle, or a policy whose `spaces` it was trained with.
        environment: Where it shall act.

    Raises:
        PolicyError: It was trained with other spaces.
    """
    if isinstance(policy, Bundle):
        _check_bundle(name, policy, environment)
        return
    here = environment.observation_space, environment.action_space
    trained: Any = getattr(policy, "spaces", here)
    for word, own, other in zip(("observations", "actions"), trained, here, strict=True):
        if not _is_alike(own, other):
            raise PolicyError(
                f"policy '{name}' was trained with {word} of {_brief(own)}; this environment has "
                f"{_brief(other)}."
            )


def _check_bundle(name: str, bundle: Bundle, environment: gym.Env[Any, Any]) -> None:
    """See that a bundle fits an environment.

    Raises:
        PolicyError: It sees or does something else.
    """
    seen, here = bundle.observation.shape, environment.observation_space
    if here.shape != seen:
        raise PolicyError(
            f"policy '{name}' sees observations of shape {seen}; this environment has "
            f"{_shown(here)}."
        )
    space, action = environment.action_space, bundle.action
    fits = (
        isinstance(space, spaces.Discrete)
        and (int(space.n), int(space.start)) == (action.outputs, action.start)
        if isinstance(action, ChoiceLayout)
        else isinstance(space, spaces.Box) and space.shape == action.shape
    )
    if not fits:
        kind = (
            f"one of {action.outputs} choices from {action.start} on"
            if isinstance(action, ChoiceLayout)
            else f"numbers of shape {action.shape}"
        )
        raise PolicyError(
            f"policy '{name}' decides on {kind}; this environment takes {_shown(space)}."
        )


def _shown(space: gym.Space[Any]) -> str:
    """The shape of numbers, which the many bounds of a `Box` would hide; others as they are."""
    return f"shape {space.shape}" if isinstance(space, spaces.Box) else _brief(space)


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
