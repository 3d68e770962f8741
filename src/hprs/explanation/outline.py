"""What plots draw of an episode: everything, or of a long one what the eye can tell apart.

A long episode is cut into stretches. Of each the plots show the least and the greatest margin, and
the potential in its first, its lowest and its highest state, so that no spike is lost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from hprs.explanation.explanation import Explanation, Numbers, Part

FINE = 2_000
"""States up to which everything is drawn."""
STRETCHES = 600
"""Into how many stretches a longer episode is cut, at most."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Which states and stretches of an episode are drawn."""

    states: int
    """How many the episode has."""
    starts: npt.NDArray[np.int_]
    """First state of every stretch."""
    stops: npt.NDArray[np.int_]
    """States that are drawn, and at which a cursor can stop."""

    @property
    def is_exact(self) -> bool:
        """Whether every state is drawn."""
        return len(self.starts) == self.states

    @property
    def length(self) -> int:
        """States of a stretch; the last one may be shorter."""
        return math.ceil(self.states / len(self.starts))

    @cached_property
    def ends(self) -> npt.NDArray[np.int_]:
        """Last state of every stretch."""
        return np.append(self.starts[1:], self.states) - 1

    def least(self, values: Numbers) -> Numbers:
        """The least value of every stretch."""
        return np.minimum.reduceat(values, self.starts)

    def greatest(self, values: Numbers) -> Numbers:
        """The greatest value of every stretch."""
        return np.maximum.reduceat(values, self.starts)

    def violated(self, part: Part) -> list[tuple[int, int]]:
        """First and last state of all rows of stretches in which a requirement fails to hold."""
        failing = np.logical_or.reduceat(~part.satisfied, self.starts)
        edges = np.diff(np.concatenate([[0], failing.view(np.int8), [0]]))
        opened, closed = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
        return [
            (int(self.starts[one]), int(self.ends[other]))
            for one, other in zip(opened, closed, strict=True)
        ]


def outline(explanation: Explanation) -> Outline:
    """What to draw of an episode."""
    states = explanation.steps + 1
    if states <= FINE:
        every = np.arange(states)
        return Outline(states, every, every)
    length = math.ceil(states / STRETCHES)
    starts = np.arange(0, states, length)
    stops = {int(start) for start in starts} | {states - 1}
    for start in starts:
        stretch = explanation.potential[start : start + length]
        stops |= {int(start + np.argmin(stretch)), int(start + np.argmax(stretch))}
    for part in explanation.parts:
        stops |= {step for step in (part.first_violation, part.met_from) if step is not None}
        stops.add(int(np.argmin(part.margins)))
    return Outline(states, starts, np.array(sorted(stops)))


@dataclass(frozen=True)
class Axis:
    """Where a margin is drawn: 0 in the middle, below it down to l, above it up to u.

    Each half has a scale of its own, since only its distance from 0 relative to l decides a score,
    and l and u may differ a hundredfold. Margins beyond their bounds stretch their half.
    """

    bottom: float
    top: float

    def place(self, margins: Numbers) -> Numbers:
        """Height from 0 (bottom) to 1 (top)."""
        clipped = np.clip(margins, self.bottom, self.top)
        return 0.5 + 0.5 * np.where(clipped < 0.0, -clipped / self.bottom, clipped / self.top)


def axis(part: Part) -> Axis:
    """The axis of a requirement's margins."""
    known = part.margins[np.isfinite(part.margins)]
    ends = [*(bound for bound in (part.low, part.high) if math.isfinite(bound))]
    ends += [float(known.min()), float(known.max())] if len(known) else []
    bottom, top = min(ends, default=0.0), max(ends, default=0.0)
    span = max(-bottom, top) or 1.0
    return Axis(bottom if bottom < 0.0 else -span, top if top > 0.0 else span)
