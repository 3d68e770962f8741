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
    # A rounded block with one long bend to the right on its back straight.
    "gm": Design(
        length=21.25,
        start=1.0,
        points=(
            (-2.0, 0.0, 1.50), (0.0, 0.0, 1.50), (2.2, 0.0, 1.50), (4.3, 0.1, 1.60),
            (5.9, 1.5, 1.70), (5.7, 3.6, 1.70), (3.8, 4.7, 1.60), (1.7, 4.25, 1.45),
            (-0.2, 3.75, 1.40), (-2.1, 4.3, 1.50), (-4.2, 4.3, 1.65), (-5.6, 2.9, 1.70),
            (-5.4, 1.0, 1.70), (-3.9, 0.0, 1.60),
        ),
    ),
    # A 13 m straight, a wide hairpin, a straight back, an S that narrows to 1 m and widens to 2 m.
    "trt": Design(
        length=51.65,
        start=2.0,
        points=(
            (-5.0, 0.0, 1.50), (-2.5, 0.0, 1.45), (0.0, 0.0, 1.45), (2.5, 0.0, 1.45),
            (5.0, 0.0, 1.45), (7.5, 0.0, 1.45), (10.0, 0.0, 1.50), (12.3, 0.5, 1.70),
            (13.7, 2.2, 1.80), (13.7, 4.4, 1.70), (12.0, 6.0, 1.55), (9.6, 6.3, 1.45),
            (7.1, 6.3, 1.45), (4.6, 6.3, 1.45), (2.1, 6.3, 1.45), (-0.3, 6.2, 1.45),
            (-2.3, 5.1, 1.40), (-4.0, 3.6, 1.20), (-6.1, 3.1, 1.00), (-8.0, 4.1, 1.15),
            (-10.1, 4.9, 1.70), (-11.9, 3.6, 2.10), (-11.5, 1.0, 1.90), (-9.0, 0.0, 1.60),
        ),
    ),
    # Nearly a circle, with two short straights.
    "gm-c": Design(
        length=13.50,
        start=0.5,
        points=(
            (-1.3, 0.0, 1.50), (1.3, 0.0, 1.50), (2.75, 1.1, 1.55), (2.75, 2.9, 1.55),
            (1.3, 4.0, 1.50), (-1.3, 4.0, 1.50), (-2.75, 2.9, 1.55), (-2.75, 1.1, 1.55),
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
