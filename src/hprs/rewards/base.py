"""The one shape of every reward."""

from __future__ import annotations

from typing import Any, Protocol

from hprs.semantics.evaluation import Signals
from hprs.spec.namespace import Array


class Reward(Protocol):
    """A reward as a pair of pure functions, over one state or a batch of states.

    Wrappers and training loops hold the memory; a reward holds none. Both functions run on Python
    floats, NumPy, JAX (under `jit`, `vmap`, `scan`) and PyTorch.
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
