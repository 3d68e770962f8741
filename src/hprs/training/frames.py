"""Observations that repeat what earlier ones showed, taken apart into frames.

A stack of the last three scans is remembered as one scan a step: a third of the memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Frames:
    """How observations of n components are made of frames of F.

    In the first steps of an episode its first frame stands for those before it.
    """

    newest: tuple[int, ...]
    """Components of an observation that make its own frame, (F,)."""
    column: tuple[int, ...]
    """Of every component the column of the frame that it comes from, (n,)."""
    lag: tuple[int, ...]
    """Of every component how many steps old that frame is, (n,)."""

    @property
    def depth(self) -> int:
        """Steps that an observation reaches back."""
        return max(self.lag, default=0)


def frames_of(simulation: Any, size: int) -> Frames:
    """The frames of a simulation's observations; each is its own where nothing is said.

    Args:
        simulation: It may have `history`: of every component the one that it repeats, (n,), and
            after how many steps, (n,); one that is new repeats itself after 0.
        size: Components of an observation, n.
    """
    everything = np.arange(size)
    repeats, lag = getattr(simulation, "history", (everything, np.zeros(size, int)))
    newest = np.flatnonzero(np.asarray(lag) == 0)
    column = np.searchsorted(newest, repeats)
    return Frames(tuple(newest.tolist()), tuple(column.tolist()), tuple(np.asarray(lag).tolist()))
