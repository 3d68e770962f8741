"""The lists of walls of every grid cell: which a car in the cell can see, touch or be closest to.

What a lidar scan costs grows with the longest list, so walls leave a list, but only by proof: what
is missing cannot be seen or touched and is not the closest from any drivable point of the cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hprs.carsim.geometry import Points, cross, inside, point_distances, ray_lengths
from hprs.carsim.track import BODY_REACH, CELL, SIGHT

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

_SPLIT = 4
"""A cell is treated as so many squares a side; those without drivable points do not count."""
_SLACK = 1e-3
"""Squares are larger by this, in m, so that rounding a position to float32 cannot leave them."""
_RAYS = 180
_BORDER = 0.5


@dataclass(frozen=True)
class Cells:
    """The grid of a track and its lists; rows are filled up with the number of walls."""

    origin: Points
    columns: int
    visible: Indices
    near: Indices
    closest: Indices


def list_walls(loops: list[Points]) -> Cells:
    """The grid and the lists of a track.

    Args:
        loops: Segments of each closed wall (S, 4), the free space on their left.
    """
    walls = np.concatenate(loops)
    points = walls[:, :2]
    origin = np.floor((points.min(axis=0) - _BORDER) / CELL) * CELL
    columns, rows = np.ceil((points.max(axis=0) + _BORDER - origin) / CELL).astype(int)
    chain = _chain(loops)
    lists: tuple[list[Indices], ...] = ([], [], [])
    for row in range(rows):
        corners = origin + np.stack([np.arange(columns), np.full(columns, row)], axis=1) * CELL
        gaps = point_distances(corners + CELL / 2, walls)
        for corner, gap in zip(corners, gaps, strict=True):
            for each, found in zip(lists, _cell(corner, gap, walls, chain), strict=True):
                each.append(found)
    visible, near, closest = (_table(each, filler=len(walls)) for each in lists)
    return Cells(origin, int(columns), visible, near, closest)


def _cell(
    corner: Points, gap: Points, walls: Points, chain: Indices
) -> tuple[Indices, Indices, Indices]:
    """The lists of a cell, from its lower left corner and the gaps from its middle to the walls."""
    squares = _squares(corner)
    middles = squares.mean(axis=1)
    drivable = inside(middles, walls)
    reach = CELL / np.sqrt(2) + 2 * _SLACK
    if gap.min() <= reach:
        close = walls[gap <= reach]
        drivable |= (square_gaps(squares, close) == 0).any(axis=1)
    if not drivable.any():
        nothing = np.zeros(0, np.intp)
        return nothing, nothing, np.array([gap.argmin()])
    # Nothing below looks further. Where the chain skips a wall, it does not continue.
    local = np.flatnonzero(gap <= max(SIGHT, gap.min() + reach) + reach)
    chain = np.searchsorted(local, chain[np.isin(chain, local)])
    squares, middles = squares[drivable], middles[drivable & inside(middles, walls)]
    visible, near, closest = _lists(squares, middles, walls[local], chain)
    return local[visible], local[near], local[closest]


def _lists(
    squares: Points, middles: Points, walls: Points, chain: Indices
) -> tuple[Indices, Indices, Indices]:
    gaps = square_gaps(squares, walls)
    furthest = point_distances(squares.reshape(-1, 2), walls).reshape(len(squares), 4, -1)
    closest = (gaps <= furthest.max(axis=1).min(axis=1)[:, None]).any(axis=0)
    facing = _sides(walls, squares.reshape(-1, 2)).max(axis=1) > 0
    near = facing & (gaps.min(axis=0) <= BODY_REACH)
    candidates = np.flatnonzero(facing & (gaps.min(axis=0) <= SIGHT))
    seen = np.isin(candidates, _hit(middles, walls))
    doubtful = candidates[~seen]
    shown = _shown(squares, gaps, walls, doubtful, chain)
    visible = np.union1d(candidates[seen], doubtful[shown])
    return visible, np.flatnonzero(near), np.flatnonzero(closest)


def _shown(
    squares: Points, gaps: Points, walls: Points, doubtful: Indices, chain: Indices
) -> Flags:
    """Which walls are not proven to be hidden from every one of the squares."""
    # A hull of all squares first: one proof then serves for all of them.
    low, high = squares.min(axis=(0, 1)), squares.max(axis=(0, 1))
    hull = np.array([low, [high[0], low[1]], high, [low[0], high[1]]])
    free_of = square_gaps(hull[None], walls)[0] > 0
    shown = ~hidden(hull, walls[doubtful], walls[chain], free_of[chain])
    suspects, shown[:] = np.flatnonzero(shown), False
    for square, gap in zip(squares, gaps, strict=True):
        if not len(suspects):
            break
        proven = hidden(square, walls[doubtful[suspects]], walls[chain], gap[chain] > 0)
        shown[suspects[~proven]] = True
        suspects = suspects[proven]
    return shown


def hidden(square: Points, targets: Points, chain: Points, usable: Flags) -> Flags:
    """Which walls are proven to be invisible from every point of a square.

    The lines of sight from a square to a wall `ab` fill the convex hull of both. Beside the square
    and the wall it has two sides, from `a` and from `b` to a corner each. A chain of joined walls
    inside the hull that joins these sides and touches neither the square nor the wall parts them.

    Args:
        square: Corners (4, 2).
        targets: The walls in question (T, 4).
        chain: Walls that may hide them, each followed by its neighbour where it has one (S, 4).
        usable: Whether they keep clear of the square (S,).

    Returns:
        (T,).
    """
    a, b = targets[:, :2], targets[:, 2:]
    sides = _sides(targets, square)
    behind, astride = (sides <= 0).all(axis=1), (sides <= 0).any(axis=1)
    corner_a = _extreme(square, a, b - a, sides)
    corner_b = _extreme(square, b, a - b, sides)
    start, end = chain[None, :, :2], chain[None, :, 2:]
    hull = [a[:, None], b[:, None], corner_b[:, None], corner_a[:, None]]
    start_in, end_in = _within(start, hull), _within(end, hull)
    through_a = _cross_each(start, end, hull[0], hull[3]) | (end == hull[0]).all(axis=-1)
    through_b = _cross_each(start, end, hull[1], hull[2]) | (start == hull[1]).all(axis=-1)
    itself = (start == hull[0]).all(axis=-1) & (end == hull[1]).all(axis=-1)
    through_a, through_b = (flags & usable & ~itself for flags in (through_a, through_b))
    continues = np.concatenate([[False], (chain[1:, :2] == chain[:-1, 2:]).all(axis=1)])
    inner = usable & continues & start_in & end_in
    # Through which side the chain came in: 1, -1, or 0 where it did not, or was lost since.
    entered = np.where(~start_in & end_in, through_a * 1 - through_b * 1, 0)
    latest = np.maximum.accumulate(np.where(inner, 0, np.arange(len(chain))), axis=1)
    state = np.take_along_axis(entered, latest, axis=1)
    before = np.concatenate([np.zeros_like(state[:, :1]), state[:, :-1]], axis=1)
    leaves = usable & continues & start_in & ~end_in
    parted = leaves & (((before == 1) & through_b) | ((before == -1) & through_a))
    return behind | (~astride & (parted | (through_a & through_b)).any(axis=1))


def square_gaps(squares: Points, segments: Points) -> Points:
    """Distance between squares (Q, 4, 2) and segments (S, 4), 0 where they meet; (Q, S)."""
    number = len(squares)
    low, high = squares.min(axis=1)[:, None], squares.max(axis=1)[:, None]
    ends = segments.reshape(1, -1, 2)
    outside = np.maximum(np.maximum(low - ends, ends - high), 0)
    from_ends = np.hypot(*np.moveaxis(outside, -1, 0)).reshape(number, -1, 2).min(axis=-1)
    corners = squares.reshape(-1, 2)
    from_corners = point_distances(corners, segments).reshape(number, 4, -1).min(axis=1)
    first, last = segments[None, :, :2], segments[None, :, 2:]
    apart = (np.maximum(first, last) < low) | (np.minimum(first, last) > high)
    sides = _sides(segments, corners).T.reshape(number, 4, -1)
    one_side = (sides > 0).all(axis=1) | (sides < 0).all(axis=1)
    meet = ~apart.any(axis=-1) & ~one_side
    return np.where(meet, 0.0, np.minimum(from_ends, from_corners))


def _squares(corner: Points) -> Points:
    """The squares of a cell, (_SPLIT * _SPLIT, 4 corners counter-clockwise, 2)."""
    side = CELL / _SPLIT
    steps = np.arange(_SPLIT) * side
    low = corner + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 2)
    return low + np.where(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), side + _SLACK, -_SLACK)


def _hit(points: Points, walls: Points) -> Indices:
    """The walls that rays from some of the points meet first."""
    if not len(points):
        return np.zeros(0, np.intp)
    points = points[:: max(1, len(points) // 5)]
    angles = np.linspace(0, 2 * np.pi, _RAYS, endpoint=False)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    starts = np.repeat(points, _RAYS, axis=0)
    lengths = ray_lengths(starts, np.tile(directions, (len(points), 1)), walls)
    met = np.isfinite(lengths).any(axis=1)
    return np.unique(lengths[met].argmin(axis=1))


def _chain(loops: list[Points]) -> Indices:
    """Every wall twice, in order around its loop, so that a chain may pass a loop's first wall."""
    starts = np.cumsum([0, *(len(loop) for loop in loops[:-1])])
    return np.concatenate(
        [
            np.tile(np.arange(len(loop)) + start, 2)
            for loop, start in zip(loops, starts, strict=True)
        ]
    )


def _sides(walls: Points, points: Points) -> Points:
    """Cross product of walls (S, 4) with points (P, 2), positive in front of them; (S, P)."""
    along = walls[:, None, 2:] - walls[:, None, :2]
    return cross(along, points[None] - walls[:, None, :2])


def _extreme(square: Points, end: Points, along: Points, sides: Points) -> Points:
    """The corner that a line from a wall's end touches with all of square and wall on one side."""
    forward = ((square[None] - end[:, None]) * along[:, None]).sum(axis=-1)
    return square[np.arctan2(sides, forward).argmax(axis=1)]


def _within(points: Points, hull: list[Points]) -> Flags:
    """Whether points are inside a convex quadrilateral; its third side may be a point."""
    flags = np.ones(np.broadcast_shapes(points.shape, hull[0].shape)[:-1], bool)
    for index, (first, last) in enumerate(zip(hull, [*hull[1:], hull[0]], strict=True)):
        side = cross(last - first, points - first)
        flags &= side >= 0 if index == 2 else side > 0
    return flags


def _cross_each(start: Points, end: Points, first: Points, last: Points) -> Flags:
    """Whether segments cross segments, each with its ends strictly on both sides of the other."""
    along, across = last - first, end - start
    split = (cross(along, start - first) > 0) != (cross(along, end - first) > 0)
    back = cross(across, first - start) * cross(across, last - start) < 0
    return split & (cross(along, start - first) * cross(along, end - first) < 0) & back


def _table(lists: list[Indices], *, filler: int) -> Indices:
    table = np.full((len(lists), max(1, *(len(row) for row in lists))), filler, np.intp)
    for row, found in zip(table, lists, strict=True):
        row[: len(found)] = found
    return table
