"""The track: a closed corridor between walls, and where on it a car is.

A track is data. Its arrays are made once, when it is loaded, and are passed to compiled functions
as an argument: tracks of equal shapes share one compilation, and a batch may mix them. Nothing here
costs more on a larger map: the walls around a car stand in the list of its cell, and progress is
looked for near the previous one.
Axes: x right, y up, angles counter-clockwise; metres and radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

POINTS = 1024
"""Points of every centre line."""
CELL = 1.0
"""Side of a grid cell in m."""
SIGHT = 15.0
"""How far from a cell the walls in its list `visible` may be, in m: the range of the lidar."""
BODY_REACH = 0.6
"""How far from a car's centre its body may touch a wall of the list `near`, in m."""
FAR = 1e5
"""Where walls stand that only fill an array up, in m."""

# Places in m of three rounds, relative to the best one of the round before: a car that came within
# 1.6 m of arc length since the last call is found to a few centimetres. A round covers half a step
# of the one before to both sides, and a bit more for the rounding to points.
_SEARCH = (0.4 * np.arange(-4, 5), 0.1 * np.arange(-2, 3), 0.025 * np.arange(-2, 3))


@partial(
    jax.tree_util.register_dataclass,
    data_fields=[
        "centre",
        "left",
        "right",
        "length",
        "max_clearance",
        "walls",
        "origin",
        "columns",
        "visible",
        "near",
        "closest",
    ],
    meta_fields=[],
)
@dataclass(frozen=True)
class Track:
    """One track; `construct_track` makes it, `stack_tracks` batches it.

    Lists of walls hold their coordinates: a batch that looked them up by index would spend more on
    that than on what it does with them. They are filled up with walls without length far away.
    """

    centre: Array
    """Points of the centre line at equal arc lengths from the start line, (POINTS, 2), m."""
    left: Array
    """From each of them to the wall on the left, (POINTS,), m."""
    right: Array
    """From each of them to the wall on the right, (POINTS,), m."""
    length: Array
    """Arc length of the centre line, (), m."""
    max_clearance: Array
    """Largest distance of a drivable point from a wall, (), m."""
    walls: Array
    """Segments x0, y0, x1, y1 with the free space on their left, (W, 4), m."""
    origin: Array
    """Lower left corner of the grid of cells, (2,), m."""
    columns: Array
    """Cells in a row of the grid, (), integer."""
    visible: Array
    """Walls that can be seen from some point of the cell within SIGHT, (C, 4, K), m."""
    near: Array
    """Walls within BODY_REACH of some point of the cell, (C, 4, M), m."""
    closest: Array
    """Walls that are the closest one to some point of the cell, (C, 4, J), m."""


def stack_tracks(tracks: Sequence[Track]) -> Track:
    """Tracks as one batch: every array is filled up to the largest and gets a leading axis."""
    return Track(
        **{
            field.name: _stacked([np.asarray(getattr(track, field.name)) for track in tracks])
            for field in fields(Track)
        }
    )


def cell_of(track: Track, position: Array) -> Array:
    """Index of the cell that holds a position, for the rows of the lists; () integer."""
    place = jnp.floor((position - track.origin) / CELL).astype(jnp.int32)
    column = jnp.clip(place[0], 0, track.columns - 1)
    # Positions off the grid belong to a cell of its rim; a batch may have rows that no cell uses.
    return jnp.clip(place[1] * track.columns + column, 0, track.visible.shape[0] - 1)


def progress(track: Track, position: Array, previous: Array) -> Array:
    """Arc length from the start line to the foot of a position on the centre line.

    Args:
        track: The track.
        position: (2,), m.
        previous: The progress of a position up to 1.6 m of arc length away. Where two stretches of
            the track run side by side, this tells which of them is meant.

    Returns:
        () in [0, length), m.
    """
    spacing = track.length / POINTS
    guess = previous
    for offsets in _SEARCH:
        places = guess + jnp.asarray(offsets, position.dtype)
        points = _take(track.centre, jnp.round(places / spacing).astype(jnp.int32))
        guess = places[jnp.argmin(jnp.sum((points - position) ** 2, axis=-1))]
    found = _foot(track, position, jnp.round(guess / spacing).astype(jnp.int32))
    # As an index NaN is some number.
    return found + 0 * previous


def locate(track: Track, position: Array) -> Array:
    """Progress of a position without a previous one, from the whole centre line; () m."""
    nearest = jnp.argmin(jnp.sum((track.centre - position) ** 2, axis=-1))
    return _foot(track, position, nearest.astype(jnp.int32))


def advance(track: Track, before: Array, after: Array) -> Array:
    """Distance from one progress to the next across the start line, in [-length/2, length/2), m."""
    half = track.length / 2
    return jnp.mod(after - before + half, track.length) - half


def pose_at(track: Track, s: Array, offset: Array | float = 0.0) -> Array:
    """Position and heading (x, y, yaw) at a progress, `offset` m left of the centre line; (3,)."""
    place = s / (track.length / POINTS)
    index = jnp.floor(place).astype(jnp.int32)
    part = place - index
    around = _take(track.centre, index + np.arange(-1, 3))
    before, here, there, beyond = around[0], around[1], around[2], around[3]
    tangent = (1 - part) * (there - before) + part * (beyond - here)
    tangent = tangent / jnp.hypot(tangent[0], tangent[1])
    normal = jnp.stack([-tangent[1], tangent[0]])
    position = (1 - part) * here + part * there + offset * normal
    return jnp.concatenate([position, jnp.arctan2(tangent[1], tangent[0])[None]])


def wall_distance(track: Track, position: Array) -> Array:
    """Distance from a position to the nearest wall, (), m."""
    x0, y0, x1, y1 = track.closest[cell_of(track, position)]
    x, y = position[0] - x0, position[1] - y0
    along_x, along_y = x1 - x0, y1 - y0
    # A wall without length is its point.
    squared = jnp.maximum(along_x**2 + along_y**2, jnp.finfo(x0.dtype).tiny)
    part = jnp.clip((x * along_x + y * along_y) / squared, 0, 1)
    return jnp.sqrt(jnp.min((x - part * along_x) ** 2 + (y - part * along_y) ** 2))


def clearance(track: Track, position: Array) -> Array:
    """Normalised wall distance: 0 at a wall, 1 at the most roomy place of the track; ()."""
    return wall_distance(track, position) / track.max_clearance


def _foot(track: Track, position: Array, index: Array) -> Array:
    """Arc length of the point closest to a position on the four segments around a point."""
    points = _take(track.centre, index + np.arange(-2, 3))
    starts, along = points[:-1], points[1:] - points[:-1]
    part = jnp.sum((position - starts) * along, axis=-1) / jnp.sum(along**2, axis=-1)
    part = jnp.clip(part, 0, 1)
    gaps = position - starts - part[:, None] * along
    best = jnp.argmin(jnp.sum(gaps**2, axis=-1))
    s = (jnp.mod(index - 2 + best, POINTS) + part[best]) * (track.length / POINTS)
    # The last segment ends where the first one starts.
    return jnp.where(s >= track.length, jnp.zeros_like(s), s)


def _take(points: Array, index: Array) -> Array:
    return points[jnp.mod(index, POINTS)]


def _stacked(arrays: list[np.ndarray]) -> Array:
    """Arrays along a new first axis; only arrays of walls differ in shape."""
    shape = np.max([array.shape for array in arrays], axis=0)
    stack = np.full((len(arrays), *shape.astype(int)), FAR, arrays[0].dtype)
    for row, array in enumerate(arrays):
        stack[(row, *map(slice, array.shape))] = array
    return jnp.asarray(stack)
