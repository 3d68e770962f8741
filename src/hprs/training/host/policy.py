"""A compiled policy as evaluations on the host call it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from hprs.training.evaluation import SIDE_BY_SIDE


class PaddedPolicy:
    """Actions of a compiled function, which is given as many rows every time.

    Args:
        best: Observations (B, n) to actions as the environment takes them.
    """

    def __init__(self, best: Callable[[Any], Any]) -> None:
        self._best = best

    def __call__(self, observation: Any, /) -> Any:
        """The action to take."""
        return self.batch([observation])[0]

    def batch(self, observations: Sequence[Any]) -> Sequence[Any]:
        """One action for each observation."""
        rows = np.stack([np.asarray(one, np.float32).ravel() for one in observations])
        # Padded: another number of rows would be compiled anew.
        wide = np.zeros((SIDE_BY_SIDE, rows.shape[1]), np.float32)
        wide[: len(rows)] = rows
        return list(np.asarray(self._best(wide))[: len(rows)])
