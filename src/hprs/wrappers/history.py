"""Wrappers that Gymnasium lacks: histories in a flat observation, and actions that are changes.

They stand above the task, as everything does that changes what the policy sees or does: signals
read observations and actions as the environment below has them. Stacks of whole observations are
Gymnasium's `FrameStackObservation(env, n, padding_type="reset")`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from hprs.errors import UsageError
from hprs.wrappers.arguments import require_environment
from hprs.wrappers.signals import zero_action


class ActionHistory(gym.Wrapper[Any, Any, Any, Any]):
    """Puts the last actions in front of a flat observation, the oldest first.

    They are clipped to the action space, so that the observation stays in its own; the environment
    gets them as they came. Before the first action all are zero, clipped likewise, or `start`.

    Args:
        env: With a Box of one axis as its observations, and a Box as its actions.
        length: How many actions.
        start: The action that counts as taken before the first one.

    Raises:
        UsageError: The environment has other spaces, or an argument is wrong.
    """

    def __init__(self, env: gym.Env[Any, Any], length: int, *, start: Any = None) -> None:
        require_environment(env, vector=False)
        super().__init__(env)
        seen, done = _flat(env, "ActionHistory"), _box(env.action_space, "ActionHistory", "actions")
        self.length = _count("length", length)
        self._bounds = done.low, done.high
        self._start = zero_action(done) if start is None else _action("start", start, done)
        self._actions = np.stack([self._start] * self.length)
        dtype = np.result_type(seen.dtype, done.dtype)
        self.observation_space = spaces.Box(
            np.concatenate([np.tile(done.low.ravel(), self.length), seen.low]).astype(dtype),
            np.concatenate([np.tile(done.high.ravel(), self.length), seen.high]).astype(dtype),
            dtype=dtype.type,
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Reset, and forget all actions."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._actions = np.stack([self._start] * self.length)
        return self._extended(observation), info

    def step(self, action: Any) -> tuple[np.ndarray, Any, bool, bool, dict[str, Any]]:
        """Step, and remember the action."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        low, high = self._bounds
        newest = np.clip(np.asarray(action), low, high)
        self._actions = np.concatenate([self._actions[1:], newest[None]])
        return self._extended(observation), reward, terminated, truncated, info

    def _extended(self, observation: np.ndarray) -> np.ndarray:
        whole = np.concatenate([self._actions.ravel(), observation])
        return whole.astype(self.observation_space.dtype, copy=False)


class ObservationHistory(gym.Wrapper[Any, Any, Any, Any]):
    """Repeats parts of a flat observation as they were in the last steps, the oldest first.

    What is not repeated comes first. At reset the history is full of the reset observation.

    Args:
        env: With a Box of one axis as its observations.
        length: How many observations, the newest included.
        indices: The components to repeat; None: all.

    Raises:
        UsageError: The environment has other observations, or an argument is wrong.
    """

    def __init__(
        self, env: gym.Env[Any, Any], length: int, *, indices: Sequence[int] | None = None
    ) -> None:
        require_environment(env, vector=False)
        super().__init__(env)
        seen = _flat(env, "ObservationHistory")
        size = seen.shape[0]
        self.length = _count("length", length)
        chosen = range(size) if indices is None else list(indices)
        wrong = [index for index in chosen if not 0 <= index < size]
        if wrong or len(set(chosen)) < len(chosen):
            raise UsageError(
                f"indices are different whole numbers from 0 to {size - 1}, not {indices}."
            )
        self._repeated = np.array(chosen, int)
        self._once = np.setdiff1d(np.arange(size), self._repeated)
        self._history = np.zeros((self.length, len(self._repeated)), seen.dtype)
        low, high = (
            np.concatenate([end[self._once], np.tile(end[self._repeated], self.length)])
            for end in (seen.low, seen.high)
        )
        self.observation_space = spaces.Box(low, high, dtype=seen.dtype.type)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Reset, and fill the history with the reset observation."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._history = np.tile(observation[self._repeated], (self.length, 1))
        return self._extended(observation), info

    def step(self, action: Any) -> tuple[np.ndarray, Any, bool, bool, dict[str, Any]]:
        """Step, and remember the observation."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        newest = observation[self._repeated]
        self._history = np.concatenate([self._history[1:], newest[None]])
        return self._extended(observation), reward, terminated, truncated, info

    def _extended(self, observation: np.ndarray) -> np.ndarray:
        return np.concatenate([observation[self._once], self._history.ravel()])


class IncrementAction(gym.Wrapper[Any, Any, Any, Any]):
    """Makes some components of the action changes of what the environment is told.

    The policy's component in [-1, 1] changes the command by up to `step`; the command stays within
    the environment's action space. `info["command"]` is what the environment was told.

    Args:
        env: With a Box of one axis as its actions.
        index: The component that becomes a change.
        step: Its largest change in one step, in the unit of the environment's action.
        start: The command before the first change; None: zero clipped to the action space.

    Raises:
        UsageError: The environment has other actions, or an argument is wrong.
    """

    def __init__(
        self, env: gym.Env[Any, Any], index: int, *, step: float, start: float | None = None
    ) -> None:
        require_environment(env, vector=False)
        super().__init__(env)
        space = _box(env.action_space, "IncrementAction", "actions")
        size = space.shape[0] if len(space.shape) == 1 else 0
        if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < size:
            raise UsageError(f"index is a component of the action, from 0 to {size - 1}: {index}.")
        if not 0 < step < math.inf:
            raise UsageError(f"step is a finite number above 0, not {step}.")
        self.index, self.step_size = index, float(step)
        self._low, self._high = float(space.low[index]), float(space.high[index])
        zero = float(zero_action(space)[index])
        self._start = zero if start is None else float(start)
        if not self._low <= self._start <= self._high:
            raise UsageError(f"start lies in [{self._low:g}, {self._high:g}], not {start}.")
        low, high = space.low.copy(), space.high.copy()
        low[index], high[index] = -1, 1
        self.action_space = spaces.Box(low, high, dtype=space.dtype.type)
        self._command = self._start

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset, and begin with the first command."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._command = self._start
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Change the command, and step with it."""
        told = np.array(action, self.action_space.dtype)
        if told.shape != self.action_space.shape:
            raise UsageError(f"An action has shape {self.action_space.shape}, not {told.shape}.")
        if not np.isfinite(told).all():
            wrong = int(np.flatnonzero(~np.isfinite(told))[0])
            raise UsageError(f"An action is finite; component {wrong} is {told[wrong]}.")
        change = self.step_size * float(np.clip(told[self.index], -1, 1))
        self._command = float(np.clip(self._command + change, self._low, self._high))
        told[self.index] = self._command
        observation, reward, terminated, truncated, info = self.env.step(told)
        return observation, reward, terminated, truncated, {**info, "command": told.copy()}


def _flat(env: gym.Env[Any, Any], name: str) -> spaces.Box:
    space = _box(env.observation_space, name, "observations")
    if len(space.shape) != 1:
        raise UsageError(f"{name} needs observations of one axis, got shape {space.shape}.")
    return space


def _box(space: gym.Space[Any], name: str, what: str) -> spaces.Box:
    if not isinstance(space, spaces.Box):
        raise UsageError(f"{name} needs {what} that are a Box, got a {type(space).__name__}.")
    return space


def _count(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 1:
        raise UsageError(f"{name} is a whole number from 1 on, not {value!r}.")
    return value


def _action(name: str, value: Any, space: spaces.Box) -> np.ndarray:
    action = np.asarray(value, space.dtype)
    if not space.contains(action):
        raise UsageError(f"{name} is an action of {space}, not {value!r}.")
    return action
