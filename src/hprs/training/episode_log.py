"""Brings back a running episode that cannot be copied, by doing its actions again.

A simulator such as Box2D keeps its state where Python cannot reach it. From the same state of the
random generator, a deterministic environment answers the same actions with the same observations.
"""

from __future__ import annotations

import hashlib
import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from hprs.training.random_states import generator_state, set_generator_state

LONGEST = 100_000
"""Steps after which an episode's actions are not kept any longer."""

_NUMBER = struct.Struct("d")


@dataclass(frozen=True)
class EpisodeState:
    """What brings a running episode back."""

    start: Mapping[str, Any]
    """The generator's state before the reset, and the reset's seed and options, as JSON."""
    actions: np.ndarray
    """The actions since, (steps, ...)."""
    lost: str = ""
    """Why it cannot be brought back, if it cannot."""

    def to_json(self) -> dict[str, Any]:
        """All but the actions."""
        return {"start": dict(self.start), "lost": self.lost}


class EpisodeLog(gym.Wrapper[Any, Any, Any, Any]):
    """Remembers how the running episode came about; belongs on top of all other wrappers.

    Replaying goes through the wrappers below, so that their memories come back as well.
    """

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        super().__init__(env)
        self._start: dict[str, Any] = {}
        self._actions: list[np.ndarray] = []
        self._steps = 0
        self._seen = hashlib.sha256()
        self._observation: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset, and begin a new log."""
        self._start = beginning(self, seed, options)
        self._actions, self._steps = [], 0
        observation, info = self.env.reset(seed=seed, options=options)
        self._seen = hashlib.sha256()
        self._see(observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step, and log the action."""
        self._steps += 1
        kept = self._steps <= LONGEST
        if kept:
            self._actions.append(np.array(action))
        result = self.env.step(action)
        if kept:
            self._see(result[0])
            self._seen.update(_NUMBER.pack(result[1]))
        else:
            self._observation = result[0]
        return result

    def state(self) -> EpisodeState:
        """What `replay` needs to come back here."""
        return state_of(self, self._start, self._actions, self._seen, steps=self._steps)

    def replay(self, state: EpisodeState) -> str:
        """Go back to where `state` was taken.

        Returns:
            Why that was impossible, or "". The episode must be restarted then.
        """
        if state.lost:
            return state.lost
        elsewhere = "the same actions led elsewhere"
        start = state.start
        if start["generator"] is not None:
            try:
                set_generator_state(self.unwrapped.np_random, start["generator"])
            except (ValueError, TypeError, KeyError):
                return elsewhere
        self.reset(seed=start["seed"], options=start["options"])
        for action in state.actions:
            _, _, terminated, truncated, _ = self.step(action)
            if terminated or truncated:
                return elsewhere
        return "" if self.state().start["reached"] == start["reached"] else elsewhere

    @property
    def observation(self) -> Any:
        """The newest observation."""
        return self._observation

    @property
    def seen(self) -> Any:
        """Digest of all that the running episode has shown, to be gone on with."""
        return self._seen.copy()

    def _see(self, observation: Any) -> None:
        self._observation = observation
        if type(observation) is np.ndarray:
            # What almost every environment returns; the rest takes several times as long.
            self._seen.update(observation.tobytes())
        else:
            _feed(self._seen, observation)


def beginning(
    environment: gym.Env[Any, Any], seed: int | None, options: dict[str, Any] | None = None
) -> dict[str, Any]:
    """How an episode begins that a reset is about to start."""
    return {"generator": _generator_state(environment), "seed": seed, "options": options}


def state_of(
    environment: gym.Env[Any, Any],
    start: Mapping[str, Any],
    actions: Sequence[np.ndarray],
    seen: Any,
    *,
    steps: int,
) -> EpisodeState:
    """What brings a running episode back.

    Args:
        environment: Where it runs.
        start: Its `beginning`.
        actions: Since then.
        seen: Digest of the first observation, and of observation and reward of every step since.
        steps: Of the episode.
    """
    generator = _generator_state(environment)
    lost = ""
    if generator is None:
        lost = "its environment has no random generator of Gymnasium's"
    elif steps > LONGEST:
        lost = f"it is longer than {LONGEST:,} steps"
    if lost:
        return EpisodeState({}, np.empty(0), lost)
    reached = seen.copy()
    reached.update(json.dumps(generator).encode())
    return EpisodeState({**start, "reached": reached.hexdigest()}, np.array(actions))


def _generator_state(environment: gym.Env[Any, Any]) -> dict[str, Any] | None:
    # Asking for `np_random` would make a generator where there is none.
    generator = environment.unwrapped.__dict__.get("_np_random")
    return None if generator is None else generator_state(generator)


def _feed(digest: Any, value: Any) -> None:
    """Add a value to a hash that differs where one bit of the value does."""
    if isinstance(value, Mapping):
        for key in sorted(value):
            digest.update(f"{key}:".encode())
            _feed(digest, value[key])
    elif isinstance(value, str) or value is None:
        digest.update(repr(value).encode())
    elif isinstance(value, Sequence) and not isinstance(value, np.ndarray):
        for inner in value:
            _feed(digest, inner)
    else:
        array = np.asarray(value)
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(array.tobytes())
