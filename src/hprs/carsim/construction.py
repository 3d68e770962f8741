"""Makes a track from its centre line and its walls, and refuses what no car could drive."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import numpy.typing as npt

from hprs.carsim.cells import list_walls
from hprs.carsim.geometry import (
    Points,
    closed_length,
    crossings,
    inside,
    loop_segments,
    normals,
    point_distances,
    ray_lengths,
    resample,
    signed_area,
)
from hprs.carsim.track import FAR, POINTS, Track
from hprs.errors import TrackError

NARROWEST = 0.4
"""Smallest distance between the walls of a track in m; the car is 0.31 m wide."""
SHORTEST = 5.0
"""Smallest length of a track in m: a circle around which the car's smallest turn fits."""
LONGEST = 1000.0
"""Largest length of a track in m, enough for Formula 1's at 1:10: there, the points of a centre
line are a metre apart. Longer chords cut the tightest bends: progress would be no arc length."""
FURTHEST = 10_000.0
"""Largest coordinate of a track in m: there, numbers of 32 bits are a millimetre apart."""


def construct_track(
    centre: Points,
    loops: list[Points],
    *,
    name: str,
    reverse: bool = False,
    dtype: npt.DTypeLike | None = None,
    measured: bool = False,
    around: Points | None = None,
) -> Track:
    """A track.

    Args:
        centre: Closed centre line in driving direction, the first point on the start line, (P, 2).
        loops: Closed walls in any direction, each (P, 2).
        name: What errors call it: a file, or a design.
        reverse: Drive it the other way round.
        dtype: Of its arrays; float32 unless said otherwise.
        measured: The centre line was found between the walls, so that it is not to blame.
        around: The wall that a lap goes round once, in any direction, (P, 2).

    Raises:
        TrackError: It cannot be driven; the message says where.
    """
    _check_size(centre, name)
    (centre,) = resample(centre, POINTS)
    if reverse:
        centre = np.roll(centre[::-1], 1, axis=0)
    loops = [loop_segments(_oriented(loop, loops)) for loop in loops]
    walls = np.concatenate(loops)
    _check_free(centre, walls, name, measured)
    if around is not None:
        _check_lap(centre, around, name)
    left, right = _widths(centre, walls, name)
    cells = list_walls(loops)
    arrays = {
        "centre": centre,
        "left": left,
        "right": right,
        "length": closed_length(centre),
        "max_clearance": _most_clearance(walls),
        "walls": walls,
        "origin": cells.origin,
        "visible": _listed(walls, cells.visible),
        "near": _listed(walls, cells.near),
        "closest": _listed(walls, cells.closest),
    }
    return Track(
        **{key: jnp.asarray(value, np.dtype(dtype or np.float32)) for key, value in arrays.items()},
        columns=jnp.asarray(cells.columns, np.int32),
    )


def walls_beside(centre: Points, left: Points, right: Points, *, name: str) -> list[Points]:
    """The two closed walls at given distances from a centre line.

    Raises:
        TrackError: A wall crosses itself or the other one.
    """
    across = normals(centre)
    loops = [centre + left[:, None] * across, centre - right[:, None] * across]
    met = crossings(np.concatenate([loop_segments(loop) for loop in loops]))
    if len(met):
        place = np.concatenate(loops)[met[0, 0]]
        raise TrackError(f"{name}: its walls cross near {_at(place)}: bend less, or be narrower.")
    return loops


def _listed(walls: Points, table: npt.NDArray[np.intp]) -> Points:
    """Coordinates of listed walls (C, 4, K); index W stands for none."""
    return np.concatenate([walls, np.full((1, 4), FAR)])[table].swapaxes(1, 2)


def _oriented(loop: Points, loops: list[Points]) -> Points:
    """A closed wall with the free space on its left."""
    around = sum(
        bool(inside(loop[:1], loop_segments(other))[0]) for other in loops if other is not loop
    )
    # The outer wall encloses free space and runs counter-clockwise; what stands in it, clockwise.
    return loop if (signed_area(loop) > 0) == (around % 2 == 0) else loop[::-1]


def _check_size(centre: Points, name: str) -> None:
    if not np.isfinite(centre).all():
        raise TrackError(f"{name}: its centre line holds a value that is not a finite number.")
    length = closed_length(centre)
    if not SHORTEST <= length <= LONGEST:
        raise TrackError(
            f"{name}: its centre line is {length:.4g} m long, which is not within {SHORTEST:g} m "
            f"and {LONGEST:g} m. Is the scale (the map's resolution) right?"
        )
    if np.abs(centre).max() > FURTHEST:
        raise TrackError(
            f"{name}: is {np.abs(centre).max():.4g} m from (0, 0); within {FURTHEST:g} m positions "
            "are exact. Choose a nearer origin for the map and its centre line."
        )


def _check_free(centre: Points, walls: Points, name: str, measured: bool) -> None:
    met = crossings(np.concatenate([loop_segments(centre), walls]))
    met = met[met[:, 0] < len(centre)]
    if (met[:, 1] < len(centre)).any():
        place = centre[met[met[:, 1] < len(centre)][0, 0]]
        raise TrackError(f"{name}: its centre line crosses itself near {_at(place)}.")
    outside = np.flatnonzero(~inside(centre, walls))
    if len(outside) or len(met):
        place = centre[outside[0] if len(outside) else met[0, 0]]
        if measured:
            raise TrackError(f"{name}: is too narrow near {_at(place)}: no room between its walls.")
        raise TrackError(
            f"{name}: its centre line leaves the free space near {_at(place)}. "
            "Do the centre line and the map belong together?"
        )


def turns_around(line: Points, place: Points) -> int:
    """How often a closed line runs round a place, counter-clockwise."""
    x, y = (line - place).T
    angles = np.arctan2(y, x)
    turns = (np.diff(angles, append=angles[0]) + np.pi) % (2 * np.pi) - np.pi
    return round(turns.sum() / (2 * np.pi))


def _check_lap(centre: Points, around: Points, name: str) -> None:
    if abs(turns_around(centre, around[0])) != 1:
        raise TrackError(
            f"{name}: its centre line is no lap: near {_at(centre[0])} it does not run round the "
            f"track's largest obstacle, whose wall is at {_at(around[0])}."
        )


def _widths(centre: Points, walls: Points, name: str) -> tuple[Points, Points]:
    """Distances to the walls on the left and on the right of every point of a centre line."""
    across = normals(centre)
    left, right = (
        np.concatenate([ray_lengths(*part, walls).min(axis=1) for part in _parts(centre, sign)])
        for sign in (across, -across)
    )
    gaps = np.concatenate([point_distances(p, walls).min(axis=1) for p in np.split(centre, 16)])
    narrow = int(gaps.argmin())
    if 2 * gaps[narrow] < NARROWEST:
        raise TrackError(
            f"{name}: a wall is {gaps[narrow]:.2f} m from its centre line near "
            f"{_at(centre[narrow])}; a car needs {NARROWEST / 2:g} m on both sides."
        )
    return left, right


def _parts(points: Points, directions: Points) -> list[tuple[Points, Points]]:
    return list(zip(np.split(points, 16), np.split(directions, 16), strict=True))


def _most_clearance(walls: Points) -> float:
    """Largest distance of a free point from a wall, to a millimetre, by branch and bound."""
    low, high = walls[:, :2].min(axis=0), walls[:, :2].max(axis=0)
    half = 0.5
    grid = [np.arange(a + half, b + half, 2 * half) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*grid), axis=-1).reshape(-1, 2)
    best = 0.0
    while True:
        parts = np.array_split(points, 1 + len(points) // 512)
        gaps = np.concatenate([point_distances(part, walls).min(axis=1) for part in parts])
        free = inside(points, walls)
        best = max(best, float(gaps[free].max(initial=0.0)))
        if half < 1e-3:
            return best
        # From the middle of a square nothing in it is further than this.
        reach = half * np.sqrt(2)
        points = points[(gaps + reach > best + 1e-3) & (free | (gaps <= reach))]
        half /= 2
        corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        points = (points[:, None] + corners).reshape(-1, 2)


def _at(place: Points) -> str:
    return f"({place[0]:.2f}, {place[1]:.2f}) m"
