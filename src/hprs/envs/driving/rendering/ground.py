"""What does not move: asphalt, walls, start line and the direction of travel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hprs.carsim.geometry import Points, signed_area, tangents
from hprs.carsim.track import FAR, POINTS, Track
from hprs.envs.driving.rendering.canvas import Colour, Shape

GROUND: Colour = (232, 235, 228)
ASPHALT: Colour = (84, 91, 102)
WALL: Colour = (250, 250, 247)
WALL_EDGE: Colour = (38, 43, 51)
_PAINT: Colour = (128, 134, 143)
_LIGHT: Colour = (246, 246, 243)
_DARK: Colour = (40, 44, 52)
# From outside to inside: a shadow on the ground, the wall up to its face, a shadow on the asphalt.
_BANDS: tuple[tuple[float, Colour], ...] = (
    (-0.30, (225, 228, 221)),
    (-0.22, (214, 217, 210)),
    (-0.14, WALL_EDGE),
    (-0.11, WALL),
    (-0.03, WALL_EDGE),
    (0.0, (68, 74, 85)),
    (0.09, (76, 83, 94)),
    (0.2, ASPHALT),
)
_LEAST_WALL = 4.0
"""Pixels from one side of a wall to the other."""
_CHEVRON = np.array(
    [(-0.1, 0.17), (0.02, 0.17), (0.14, 0.0), (0.02, -0.17), (-0.1, -0.17), (0.02, 0.0)]
)
_SPACING = 1.6
"""Between two marks of the direction of travel, m."""
_SQUARE = 0.16
"""Side of a square of the start line, m."""
_SHARPEST = 0.5
"""Cosine of half a corner's turn, below which its bands are cut off."""


@dataclass(frozen=True)
class Ground:
    """One track, as lines."""

    loops: tuple[Points, ...]
    """Its walls, closed, with free space on their left; what encloses others stands first."""
    centre: Points
    """Its centre line."""
    left: Points
    """From the points of the centre line to the wall on the left, m."""
    right: Points
    """From the points of the centre line to the wall on the right, m."""
    length: float
    """m."""

    @property
    def corners(self) -> tuple[Points, Points]:
        """The lower left and the upper right corner of what it covers, m."""
        points = np.concatenate(self.loops)
        return points.min(axis=0), points.max(axis=0)


def ground_of(tracks: Track, index: int) -> Ground:
    """One track of a stack."""

    def one(name: str) -> Any:
        return np.asarray(getattr(tracks, name)[index], float)

    return Ground(
        loops=tuple(sorted(_loops(one("walls")), key=signed_area, reverse=True)),
        centre=one("centre"),
        left=one("left"),
        right=one("right"),
        length=float(one("length")),
    )


def silhouette(ground: Ground, colour: Colour, around: Colour) -> list[Shape]:
    """The drivable area; what stands in it has the colour of what is around it."""
    return [(loop, colour if signed_area(loop) > 0 else around) for loop in ground.loops]


def scenery(ground: Ground, scale: float) -> list[Shape]:
    """A track, for views with so many pixels in a metre."""
    walls = [shape for loop in ground.loops for shape in _wall(loop, scale)]
    return [*walls, *_direction(ground, scale), *_start(ground, scale)]


def _loops(walls: Points) -> list[Points]:
    """Closed lines of segments (W, 4), those of one line in a row."""
    walls = walls[np.abs(walls[:, 0]) < FAR / 2]
    joined = np.all(walls[:-1, 2:] == walls[1:, :2], axis=1)
    return [part[:, :2] for part in np.split(walls, np.flatnonzero(~joined) + 1)]


def _wall(loop: Points, scale: float) -> list[Shape]:
    """A wall with its surroundings: areas that cover each other, opaque and without any joint."""
    size = max(1.0, _LEAST_WALL / (scale * 0.14))
    moved = [(_beside(loop, distance * size), colour) for distance, colour in _BANDS]
    if signed_area(loop) > 0:
        return moved
    # Around an obstacle the innermost area comes last, and is ground.
    colours = [GROUND, *(colour for _, colour in _BANDS[:-1])]
    return [(line, colour) for (line, _), colour in zip(moved, colours, strict=True)][::-1]


def _beside(loop: Points, distance: float) -> Points:
    """A closed line at a distance to the left of another one."""
    after = np.roll(loop, -1, axis=0) - loop
    after /= np.maximum(np.hypot(*after.T), 1e-9)[:, None]
    both = after + np.roll(after, 1, axis=0)
    cosine = np.hypot(*both.T) / 2
    normal = np.stack([-both[:, 1], both[:, 0]], axis=1) / (2 * np.maximum(cosine, 1e-9))[:, None]
    return loop + distance * normal / np.maximum(cosine, _SHARPEST)[:, None]


def _direction(ground: Ground, scale: float) -> list[Shape]:
    # Far away, marks are fewer and larger.
    size = max(1.0, 26 / scale)
    number = max(int(ground.length / (_SPACING * size)), 4)
    index = ((np.arange(number) + 0.5) * POINTS / number).astype(int)
    along = tangents(ground.centre)
    return [(_placed(_CHEVRON * size, ground.centre[i], along[i]), _PAINT) for i in index]


def _start(ground: Ground, scale: float) -> list[Shape]:
    side = max(_SQUARE, 4 / scale)
    along = tangents(ground.centre)[0]
    number = max(round((ground.left[0] + ground.right[0]) / side), 2)
    edges = np.linspace(-ground.right[0], ground.left[0], number + 1)
    shapes: list[Shape] = []
    for row in range(2):
        for column in range(number):
            low, high, back = edges[column], edges[column + 1], (row - 1) * side
            square = np.array([(back, low), (back, high), (back + side, high), (back + side, low)])
            colour = _LIGHT if (row + column) % 2 else _DARK
            shapes.append((_placed(square, ground.centre[0], along), colour))
    return shapes


def _placed(shape: Points, place: Points, along: Points) -> Points:
    """A shape that points along x, turned along a unit vector and put to a place."""
    return place + shape[:, :1] * along + shape[:, 1:] * np.array([-along[1], along[0]])
