"""What a learner is given of environments on the host, and what it asks of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import gymnasium as gym
import numpy as np


class Seen(NamedTuple):
    """What policy and critic see of N environments."""

    observation: np.ndarray
    """The environments', flattened, (N, n) float32."""
    signals: np.ndarray
    """The signals that the task uses, raw, in the order of its plan, vectors side by side, (N, S)
    float32."""


class Transition(NamedTuple):
    """A step of N environments; the arrays are the caller's, no later step writes to them."""

    reward: np.ndarray
    """The task's, (N,) float32."""
    terminated: np.ndarray
    """(N,) bool."""
    truncated: np.ndarray
    """(N,) bool."""
    valid: np.ndarray
    """False where the step only reset an environment: no transition, (N,) bool."""
    reached: Seen
    """The states that the actions led to; where an episode ended, its final one."""
    next: Seen
    """What the next actions are chosen from; where an episode ended, the new one's first state, or
    its final one still if the next step is what resets it. The arrays of `reached` where that is
    the same."""


class HostEnvironments(Protocol):
    """N environments with a task; an episode that has ended begins anew."""

    number: int
    """How many."""
    observation_space: gym.Space[Any]
    """Of one environment."""
    action_space: gym.Space[Any]
    """Of one environment."""

    @property
    def seen(self) -> Seen:
        """What the next actions are chosen from."""
        ...

    def reset(self, seed: int) -> Seen:
        """New episodes everywhere; the seeds of the environments are derived from one."""
        ...

    def step(self, actions: np.ndarray) -> Transition:
        """Step all environments.

        Args:
            actions: As the environments take them, (N, ...).
        """
        ...

    def state(self) -> dict[str, Any]:
        """What `restore` needs: name to a NumPy array or a JSON value."""
        ...

    def restore(self, state: Mapping[str, Any]) -> list[str]:
        """Go back to where `state` was taken, be it in other environments; `seen` is as it was.

        Returns:
            For every environment that had to begin a new episode the reason.
        """
        ...

    def close(self) -> None:
        """Close all environments."""
        ...
