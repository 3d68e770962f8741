"""The one shape of every reward, and what a reward asks of whoever learns from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hprs.semantics.evaluation import Signals
from hprs.spec.namespace import Array, namespace_of, select


class Reward(Protocol):
    """A reward as a pair of pure functions, over one state or a batch of states.

    Wrappers and training loops hold the memory; a reward holds none. Both functions run on Python
    floats, NumPy, JAX (under `jit`, `vmap`, `scan`) and PyTorch.

    A memory is made of arrays, numbers and None, in dictionaries and tuples; that of one state of
    floats may hold lists too. With a batch of n states, the first axis of every array of it has
    length n, as that of every signal has (a vector signal has shape (n, length)): so a wrapper can
    begin a new episode in some rows only.

    A reward may also have `demands`, see `demands_of`, and `components`, see `components_of`.
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
class Demands:
    """What a reward asks of the learner."""

    discount: float | None = None
    """The discount to learn with; None: whatever suits the learner."""
    horizon_is_terminal: bool = False
    """Nothing is to be expected after the horizon: do not bootstrap from a truncated episode."""


NO_DEMANDS = Demands()

PAID_AT_THE_END = Demands(discount=1.0, horizon_is_terminal=True)
"""A discount would make a late end worth less, and bootstrapping past a paid end with discount 1
diverges."""


def demands_of(reward: Reward) -> Demands:
    """What a reward asks of the learner; nothing, where it does not say."""
    return getattr(reward, "demands", NO_DEMANDS)


def components_of(reward: Reward) -> tuple[str, ...] | None:
    """Labels of the numbers that a reward pays, on the last axis; None where it pays one number."""
    return getattr(reward, "components", None)


def paid_at_the_end(
    worth: Callable[..., Array],
    running: tuple[Array, ...],
    terminated: Array,
    truncated: Array,
) -> Array:
    """What an episode so far is worth, where it ends here, for whatever reason; 0 elsewhere.

    Args:
        worth: The worth of an episode as a function of what is known of it.
        running: What is known of it so far; with a batch, arrays with the batch first.
        terminated: See `Reward.step`.
        truncated: See `Reward.step`.
    """
    ended: Any = terminated | truncated
    if isinstance(running[0], bool | float | list):
        return worth(*running) if ended else 0.0
    if _is_numpy(ended):
        # Few episodes end in one step.
        found = worth(*[known[ended] for known in running])
        paid = np.zeros(ended.shape, found.dtype)
        paid[ended] = found
        return paid
    value = worth(*running)
    return select(ended, value, namespace_of((value,)).zeros_like(value))


def _is_numpy(value: Any) -> bool:
    return isinstance(value, np.ndarray)
