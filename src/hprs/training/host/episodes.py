"""Remembers how the running episodes of many environments came about, for all of them at once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from hprs.training.episode_log import LONGEST, EpisodeLog, EpisodeState, beginning, state_of

_CHUNK = 64


class EpisodeLogs:
    """Logs as those of `EpisodeLog`, which replays them, at a fraction of the cost a step.

    Actions are kept a batch at a time, and digests are advanced some dozens of steps at a time.

    Args:
        environments: With the task.
        size: Numbers of an observation.
    """

    def __init__(self, environments: Sequence[gym.Env[Any, Any]], size: int) -> None:
        self._environments = tuple(environments)
        count = len(self._environments)
        # Without gaps: the bytes of a row are those that an `EpisodeLog` digests.
        kind = np.dtype([("observation", np.float32, (size,)), ("reward", np.float64)])
        self._chunk = np.empty((_CHUNK, count), kind)
        self._filled = 0
        self._actions: list[np.ndarray] = []
        """Since step number `_kept` of all environments."""
        self._kept, self._steps = 0, 0
        self._starts: list[dict[str, Any]] = [{}] * count
        self._begun = [0] * count
        self._digests: list[Any] = [None] * count
        self._from = [0] * count
        """Row of the chunk from which on it belongs to the running episode, once an environment."""

    def reset(self, row: int, seed: int | None = None) -> Any:
        """Reset an environment, and begin its log anew; its first observation."""
        environment = self._environments[row]
        start = beginning(environment, seed)
        observation, _ = environment.reset(seed=seed)
        digest = hashlib.sha256(np.asarray(observation, np.float32).tobytes())
        self._begin(row, start, digest, self._steps)
        return observation

    def add(self, actions: np.ndarray, observations: np.ndarray, rewards: np.ndarray) -> None:
        """Log a step of all environments, before those whose episodes ended are reset."""
        self._chunk["observation"][self._filled] = observations
        self._chunk["reward"][self._filled] = rewards
        self._actions.append(np.array(actions))
        self._steps += 1
        self._filled += 1
        if self._filled == _CHUNK:
            self._fold()

    def states(self) -> list[EpisodeState]:
        """What `replay` needs, for each environment."""
        self._fold()
        states: list[EpisodeState] = []
        for row, environment in enumerate(self._environments):
            steps = self._steps - self._begun[row]
            kept = self._actions[-steps:] if 0 < steps <= LONGEST else []
            actions = [batch[row] for batch in kept]
            states.append(
                state_of(environment, self._starts[row], actions, self._digests[row], steps=steps)
            )
        return states

    def replay(self, states: Sequence[EpisodeState], seeds: Sequence[int]) -> tuple[Any, list[str]]:
        """Go back to where all `states` were taken.

        Args:
            states: What `states` returned.
            seeds: For episodes that must begin anew.

        Returns:
            The newest observation of each environment, and why its episode began anew, or "".
        """
        self._steps = max(len(state.actions) for state in states)
        self._kept, self._filled = 0, 0
        self._actions = []
        observations: list[Any] = []
        reasons: list[str] = []
        replayed: list[np.ndarray] = []
        for row, (state, seed) in enumerate(zip(states, seeds, strict=True)):
            log = EpisodeLog(_AsLearned(self._environments[row]))
            reason = log.replay(state)
            reasons.append(reason)
            if reason:
                observations.append(self.reset(row, seed))
                replayed.append(state.actions[:0])
                continue
            start = {name: state.start[name] for name in ("generator", "seed", "options")}
            self._begin(row, start, log.seen, self._steps - len(state.actions))
            observations.append(log.observation)
            replayed.append(state.actions)
        self._actions = _side_by_side(replayed, self._steps)
        return observations, reasons

    def _begin(self, row: int, start: dict[str, Any], digest: Any, step: int) -> None:
        self._starts[row], self._digests[row] = start, digest
        self._begun[row], self._from[row] = step, self._filled

    def _fold(self) -> None:
        """Digest the chunk, and forget the actions of ended episodes."""
        for row, first in enumerate(self._from):
            self._digests[row].update(self._chunk[first : self._filled, row].tobytes())
        self._from = [0] * len(self._from)
        self._filled = 0
        oldest = min(step for step in [*self._begun, self._steps] if self._steps - step <= LONGEST)
        del self._actions[: oldest - self._kept]
        self._kept = oldest


class _AsLearned(gym.ObservationWrapper[Any, Any, Any]):
    """Observations of the type that a learner is given, in which they are logged."""

    def observation(self, observation: Any) -> np.ndarray:
        return np.asarray(observation, np.float32)


def _side_by_side(rows: Sequence[np.ndarray], steps: int) -> list[np.ndarray]:
    """The actions of episodes that end together, as batches."""
    longest = max(rows, key=len)
    batches = np.zeros((steps, len(rows), *longest.shape[1:]), longest.dtype)
    for row, actions in enumerate(rows):
        if len(actions):
            batches[steps - len(actions) :, row] = actions
    return list(batches)
