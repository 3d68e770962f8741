"""The lists of walls of every grid cell: which a car in the cell can see, touch or be closest to.

What a lidar scan costs grows with the longest list, so walls leave a list, but only by proof: what
is missing cannot be seen or touched and is not the closest from any drivable point of the cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hprs.carsim.geometry import Points, cross, inside, point_distances
from hprs.carsim.track import BODY_REACH, CELL, SIGHT

Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

_SPLIT = 4
"""A cell is treated as so many squares a side; those without drivable points do not count."""
_SLACK = 1e-3
"""Squares are larger by this, in m, so that rounding a position to float32 cannot leave them."""
_REACH = CELL / np.sqrt(2) + 2 * _SLACK
"""From the middle of a cell to the furthest point of its squares, m, rounded up."""
_ROUNDING = 1e-6
_RAYS = 120
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
        # Without a wall in it, a cell is free as a whole or not at all.
        used = (gaps.min(axis=1) <= _REACH) | inside(corners + CELL / 2, walls)
        for corner, gap, use in zip(corners, gaps, used, strict=True):
            cell = _cell(corner, gap, walls, chain) if use else _nothing(gap)
            for each, found in zip(lists, cell, strict=True):
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
    drivable |= (square_gaps(squares, walls[gap <= _REACH])[0] == 0).any(axis=1)
    if not drivable.any():
        return _nothing(gap)
    # Nothing below looks further. Where the chain skips a wall, it does not continue.
    local = np.flatnonzero(gap <= max(SIGHT, gap.min() + _REACH) + _REACH)
    chain = np.searchsorted(local, chain[np.isin(chain, local)])
    squares, middles = squares[drivable], middles[drivable & inside(middles, walls)]
    visible, near, closest = _lists(squares, middles, walls[local], chain)
    return local[visible], local[near], local[closest]


def _nothing(gap: Points) -> tuple[Indices, Indices, Indices]:
    """The lists of a cell without drivable points."""
    nothing = np.zeros(0, np.intp)
    return nothing, nothing, np.array([gap.argmin()])


def _lists(
    squares: Points, middles: Points, walls: Points, chain: Indices
) -> tuple[Indices, Indices, Indices]:
    gaps, furthest = square_gaps(squares, walls)
    closest = (gaps <= furthest.min(axis=1)[:, None]).any(axis=0)
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
    hull = np.array([[low, [high[0], low[1]], high, [low[0], high[1]]]])
    free_of = square_gaps(hull, walls)[0] > 0
    shown = ~hidden(hull, walls[doubtful], walls, chain, free_of)[0]
    suspects = np.flatnonzero(shown)
    shown[suspects] = ~hidden(squares, walls[doubtful[suspects]], walls, chain, gaps > 0).all(
        axis=0
    )
    return shown


def hidden(squares: Points, targets: Points, walls: Points, chain: Indices, usable: Flags) -> Flags:
    """Which walls are proven to be invisible from every point of a square.

    The lines of sight from a square to a wall `ab` fill the convex hull of both. Beside the square
    and the wall it has two sides, from `a` and from `b` to a corner each. A chain of joined walls
    inside the hull that joins these sides and touches neither the square nor the wall parts them.

    Args:
        squares: Corners (Q, 4, 2).
        targets: The walls in question (T, 4).
        walls: What may hide them (S, 4).
        chain: Rows of `walls`, each followed by its neighbour where it has one.
        usable: Which walls keep clear of each square (Q, S).

    Returns:
        (Q, T).
    """
    sides = _sides(targets, squares.reshape(-1, 2)).T.reshape(len(squares), 4, -1).swapaxes(1, 2)
    proven = (sides <= 0).all(axis=2)
    square, target = np.nonzero((sides > 0).all(axis=2))
    a, b, sides = targets[target, :2], targets[target, 2:], sides[square, target]
    corner_a = _extreme(squares[square], a, b - a, sides)
    corner_b = _extreme(squares[square], b, a - b, sides)
    hulls = np.stack([a, b, corner_b, corner_a], axis=1)
    # Few walls reach into a hull: from here on there is one row for each of them.
    hull, place = np.nonzero(_reaching(hulls, walls)[:, chain])
    parted = _parted(
        hulls[hull],
        walls[chain],
        place,
        np.diff(hull, prepend=-1) == 0,
        usable[square[hull], chain[place]],
    )
    found = hull[parted]
    proven[square[found], target[found]] = True
    return proven


def _reaching(hulls: Points, walls: Points) -> Flags:
    """Which walls (S, 4) are not beyond a side of convex quadrilaterals (H, 4, 2); (H, S).

    Some more by rounding: what decides is computed for each of them.
    """
    x, y = np.moveaxis(hulls, -1, 0)
    along_x, along_y = np.moveaxis(np.roll(hulls, -1, axis=1) - hulls, -1, 0)
    lines = np.stack([-along_y, along_x, along_y * x - along_x * y], axis=-1)
    beyond = np.ones((len(hulls), 4, len(walls)), bool)
    for ends in (walls[:, :2], walls[:, 2:]):
        beyond &= lines @ np.concatenate([ends.T, np.ones((1, len(ends)))]) < -_ROUNDING
    return np.asarray(~beyond.any(axis=1))


def _parted(hulls: Points, chain: Points, place: Indices, same: Flags, usable: Flags) -> Flags:
    """Where a chain of walls, as far as it came, parts the hull that it is in.

    Args:
        hulls: The wall `ab` and the corners of its square that see `b` and `a` last (P, 4, 2).
        chain: Walls (S, 4).
        place: Which of them, ascending for each hull (P,).
        same: Whether the hull is that of the row before (P,).
        usable: Whether the wall keeps clear of the square (P,).
    """
    hull = list(np.moveaxis(hulls, 1, 0))
    start, end = chain[place, :2], chain[place, 2:]
    start_in, end_in = _within(start, hull), _within(end, hull)
    through_a = _cross_each(start, end, hull[0], hull[3]) | _equal(end, hull[0])
    through_b = _cross_each(start, end, hull[1], hull[2]) | _equal(start, hull[1])
    itself = _equal(start, hull[0]) & _equal(end, hull[1])
    through_a, through_b = (flags & usable & ~itself for flags in (through_a, through_b))
    # A wall whose neighbour is missing here has it outside of the hull.
    joined = same & (np.diff(place, prepend=-1) == 1)
    joined[1:] &= _equal(start[1:], end[:-1])
    inner = usable & joined & start_in & end_in
    # Through which side the chain came in: 1, -1, or 0 where it did not, or was lost since.
    entered = np.where(~start_in & end_in, through_a * 1 - through_b * 1, 0)
    latest = np.maximum.accumulate(np.where(inner, 0, np.arange(len(place))))
    before = np.concatenate([[0], entered[latest][:-1]])[: len(place)]
    leaves = usable & joined & start_in & ~end_in
    parted = leaves & (((before == 1) & through_b) | ((before == -1) & through_a))
    return parted | (through_a & through_b)


def square_gaps(squares: Points, segments: Points) -> tuple[Points, Points]:
    """Distances of the nearest and of the furthest point of squares from segments; each (Q, S).

    Args:
        squares: Corners (Q, 4, 2).
        segments: (S, 4).
    """
    number = len(squares)
    low, high = squares.min(axis=1)[:, None], squares.max(axis=1)[:, None]
    ends = segments.reshape(1, -1, 2)
    outside = np.maximum(np.maximum(low - ends, ends - high), 0)
    from_ends = np.hypot(*np.moveaxis(outside, -1, 0)).reshape(number, -1, 2).min(axis=-1)
    corners = squares.reshape(-1, 2)
    from_corners = point_distances(corners, segments).reshape(number, 4, -1)
    first, last = segments[None, :, :2], segments[None, :, 2:]
    apart = (np.maximum(first, last) < low) | (np.minimum(first, last) > high)
    sides = _sides(segments, corners).T.reshape(number, 4, -1)
    one_side = (sides > 0).all(axis=1) | (sides < 0).all(axis=1)
    meet = ~apart.any(axis=-1) & ~one_side
    gaps = np.where(meet, 0.0, np.minimum(from_ends, from_corners.min(axis=1)))
    return gaps, from_corners.max(axis=1)


def _squares(corner: Points) -> Points:
    """The squares of a cell, (_SPLIT * _SPLIT, 4 corners counter-clockwise, 2)."""
    side = CELL / _SPLIT
    steps = np.arange(_SPLIT) * side
    low = corner + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 1, 2)
    return low + np.where(np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), side + _SLACK, -_SLACK)


def _hit(points: Points, walls: Points) -> Indices:
    """The walls that rays from some of the points meet first."""
    angles = np.linspace(0, 2 * np.pi, _RAYS, endpoint=False)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    found = [np.zeros(0, np.intp)]
    for point in points[:: max(1, len(points) // 5)]:
        start, end = walls[:, :2] - point, walls[:, 2:] - point
        area = cross(start, end)
        facing = np.flatnonzero(area > 0)
        start, end, area = start[facing], end[facing], area[facing, None]
        # As in the lidar: a wall is met between its ends, the nearest has the largest inverse.
        met = (rays @ _turned(start).T <= 0) & (rays @ _turned(end).T >= 0)
        closeness = np.where(met, rays @ (_turned(end - start) / area).T, 0.0)
        nearest = closeness.argmax(axis=1)
        found.append(facing[nearest[met[np.arange(_RAYS), nearest]]])
    return np.unique(np.concatenate(found))


def _turned(vectors: Points) -> Points:
    """Vectors a quarter clockwise: whose product with another is the cross product with it."""
    return np.stack([vectors[:, 1], -vectors[:, 0]], axis=1)


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


def _extreme(squares: Points, end: Points, along: Points, sides: Points) -> Points:
    """The corner that a line from a wall's end touches with all of square and wall on one side."""
    forward = ((squares - end[:, None]) * along[:, None]).sum(axis=-1)
    return squares[np.arange(len(squares)), np.arctan2(sides, forward).argmax(axis=1)]


def _equal(first: Points, second: Points) -> Flags:
    return (first[..., 0] == second[..., 0]) & (first[..., 1] == second[..., 1])


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
