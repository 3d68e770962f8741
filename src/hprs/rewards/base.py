"""The one shape of every reward, and the simplest rewards of that shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

from hprs.semantics.evaluation import Signals
from hprs.spec.namespace import Array
from hprs.spec.task import Task


class Reward(Protocol):
    """A reward as a pair of pure functions, over one state or a batch of states.

    Wrappers and training loops hold the memory; a reward holds none. Both functions run on Python
    floats, NumPy, JAX (under `jit`, `vmap`, `scan`) and PyTorch.

    A memory is made of arrays, numbers and None, in dictionaries and tuples. With a batch of n
    states, the first axis of every array of it has length n, as that of every signal has (a vector
    signal has shape (n, length)): so a wrapper can begin a new episode in some rows only.
    """

    def init(self, signals: Signals) -> Any:
        """The memory at the start of an episode, from the signals of s_0."""
        ...

    def step(
        self, memory: Any, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[Any, Array]:
        """The memory and the reward of the transition into a state.

        Args:
            memory: What `init` or the step before returned.
            signals: The signals of the state reached; batch shape B.
            terminated: Whether the task ended in it; a bool, or an array of shape B.
            truncated: Whether the episode was cut off in it; the same forms.
        """
        ...


@dataclass(frozen=True)
class StateReward:
    """A reward of the state reached alone: nothing is remembered, and no end of an episode matters.

    Args:
        task: The task.
        paid: The reward of a state, from the task and the state's signals.
    """

    task: Task
    paid: Callable[[Task, Signals], Array]

    def init(self, signals: Signals) -> None:
        """Nothing to remember."""
        del signals

    def step(
        self, memory: None, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[None, Array]:
        """What the state reached is worth."""
        del memory, terminated, truncated
        return None, self.paid(self.task, signals)
