"""The built-in tracks, named as the paper's and of the paper's lengths.

Maps of the originals are public nowhere. A design is a closed uniform cubic B-spline, whose
curvature is continuous, over a few control points in driving direction with the width of the
corridor at each; it is scaled to the stated length, and starts in the origin along the x axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hprs.carsim.construction import construct_track, walls_beside
from hprs.carsim.geometry import Points, closed_length, simplify
from hprs.carsim.track import Track
from hprs.errors import UsageError, did_you_mean

WALL_TOLERANCE = 0.02
"""How far the straight pieces of a wall may be from its smooth design, in m."""
_DENSITY = 1024


@dataclass(frozen=True)
class Design:
    """A closed corridor."""

    length: float
    """Arc length of the centre line in m."""
    start: float
    """Control point at which the start line is; a half is half-way to the next one."""
    points: tuple[tuple[float, float, float], ...]
    """Control points: x, y and the width of the corridor, m."""


DESIGNS = {
    "gm": Design(
        length=21.25,
        start=0.5,
        points=(
            (-1.2, 0.0, 1.5), (1.2, 0.0, 1.5), (3.6, -0.1, 1.6), (5.6, 1.0, 1.7),
            (5.7, 3.3, 1.7), (3.9, 4.6, 1.6), (1.9, 4.0, 1.5), (0.3, 3.5, 1.5),
            (-1.3, 4.3, 1.6), (-3.2, 4.2, 1.7), (-4.1, 2.2, 1.7), (-3.3, 0.3, 1.6),
        ),
    ),
}  # fmt: skip
"""Name to design."""


def load_track(name: str, *, reverse: bool = False, dtype: npt.DTypeLike | None = None) -> Track:
    """A built-in track.

    Raises:
        UsageError: There is none of this name.
    """
    if name not in DESIGNS:
        known = ", ".join(DESIGNS)
        raise UsageError(
            f"No track is called '{name}'.{did_you_mean(name, DESIGNS)} Known: {known}."
        )
    centre, width = trace(DESIGNS[name])
    return corridor(centre, width / 2, name=name, reverse=reverse, dtype=dtype)


def corridor(
    centre: Points,
    half_width: Points,
    *,
    name: str,
    reverse: bool = False,
    dtype: npt.DTypeLike | None = None,
) -> Track:
    """A track around a centre line, with walls of few straight pieces."""
    loops = walls_beside(centre, half_width, half_width, name=name)
    loops = [simplify(loop, WALL_TOLERANCE) for loop in loops]
    return construct_track(centre, loops, name=name, reverse=reverse, dtype=dtype)


def trace(design: Design) -> tuple[Points, Points]:
    """Points of a design's centre line (P, 2), and the widths there (P,)."""
    control = np.array(design.points)
    line = spline(control, _DENSITY, design.start)
    centre, width = line[:, :2], line[:, 2]
    direction = centre[1] - centre[-1]
    x, y = direction / np.hypot(*direction)
    centre = (centre - centre[0]) @ np.array([[x, -y], [y, x]])
    return centre * (design.length / closed_length(centre)), width


def spline(control: Points, number: int, start: float = 0.0) -> Points:
    """Points of the closed uniform cubic B-spline over control points (C, D), (number, D)."""
    at = start + np.arange(number) * (len(control) / number)
    index, part = np.floor(at).astype(int), at % 1
    weights = (
        (1 - part) ** 3,
        3 * part**3 - 6 * part**2 + 4,
        -3 * part**3 + 3 * part**2 + 3 * part + 1,
        part**3,
    )
    near = [control[(index + shift) % len(control)] for shift in (-1, 0, 1, 2)]
    return np.sum([w[:, None] * p for w, p in zip(weights, near, strict=True)], axis=0) / 6
