"""Plane geometry of closed lines and wall segments, in NumPy: what loading a track needs.

A closed line is an array of points (P, 2) whose last point is joined to its first one. Segments are
rows x0, y0, x1, y1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


def closed_length(line: Points) -> float:
    """Length of a closed line."""
    return float(np.hypot(*(np.roll(line, -1, axis=0) - line).T).sum())


def resample(line: Points, number: int, *values: Points) -> tuple[Points, ...]:
    """A closed line, and values along it, at `number` points of equal arc length from the first."""
    around = np.concatenate([line, line[:1]])
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(around, axis=0).T))])
    wanted = np.arange(number) * (at[-1] / number)
    columns = [*around.T, *(np.concatenate([value, value[:1]]) for value in values)]
    x, y, *rest = (np.interp(wanted, at, column) for column in columns)
    return np.stack([x, y], axis=1), *rest


def tangents(line: Points) -> Points:
    """Unit vectors along a closed line, from the neighbours of each point."""
    along = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    return along / np.hypot(*along.T)[:, None]


def normals(line: Points) -> Points:
    """Unit vectors to the left of a closed line."""
    along = tangents(line)
    return np.stack([-along[:, 1], along[:, 0]], axis=1)


def curvature(line: Points) -> Points:
    """Signed curvature at each point of an evenly spaced closed line, positive to the left, 1/m."""
    heading = np.unwrap(np.arctan2(*(np.roll(line, -1, axis=0) - line).T[::-1]))
    turn = (np.diff(heading, prepend=heading[-1]) + np.pi) % (2 * np.pi) - np.pi
    return turn / (closed_length(line) / len(line))


def signed_area(line: Points) -> float:
    """Area inside a closed line, positive where it runs counter-clockwise."""
    following = np.roll(line, -1, axis=0)
    return float(np.sum(cross(line, following)) / 2)


def simplify(line: Points, tolerance: float) -> Points:
    """A closed line with fewer points, nowhere further than `tolerance` from the first one.

    Douglas and Peucker (1973), on the two halves between the first point and the furthest from it.
    """
    far = int(np.argmax(np.hypot(*(line - line[0]).T)))
    around = np.concatenate([line, line[:1]])
    keep = np.zeros(len(around), bool)
    keep[[0, far]] = True
    pending = [(0, far), (far, len(line))]
    while pending:
        first, last = pending.pop()
        if last - first < 2:
            continue
        inner = around[first + 1 : last]
        chord = np.concatenate([around[first], around[last]])[None]
        gaps = point_distances(inner, chord)[:, 0]
        worst = int(np.argmax(gaps))
        if gaps[worst] > tolerance:
            middle = first + 1 + worst
            keep[middle] = True
            pending += [(first, middle), (middle, last)]
    return line[keep[:-1]]


def loop_segments(line: Points) -> Points:
    """The segments of a closed line, (P, 4)."""
    return np.concatenate([line, np.roll(line, -1, axis=0)], axis=1)


def cross(first: Points, second: Points) -> Points:
    """Cross product of vectors in the last axis."""
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def point_distances(points: Points, segments: Points) -> Points:
    """Distance of every point (P, 2) from every segment (S, 4); (P, S)."""
    start = segments[:, :2]
    along = segments[:, 2:] - start
    to_point = points[:, None] - start
    squared = np.maximum((along**2).sum(-1), np.finfo(float).tiny)
    part = np.clip((to_point * along).sum(-1) / squared, 0, 1)
    return np.hypot(*np.moveaxis(to_point - part[..., None] * along, -1, 0))


def inside(points: Points, segments: Points) -> NDArray[np.bool_]:
    """Whether points (P, 2) are inside the closed lines that the segments (S, 4) form."""
    x, y = points[:, :1], points[:, 1:]
    x0, y0, x1, y1 = segments.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
    crossed = ((y0 > y) != (y1 > y)) & (x < at)
    return crossed.sum(axis=1) % 2 == 1


def ray_lengths(starts: Points, directions: Points, segments: Points) -> Points:
    """Distance along rays (R, 2) to every segment (S, 4), infinite where one misses; (R, S)."""
    along = segments[:, 2:] - segments[:, :2]
    to_start = segments[None, :, :2] - starts[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        steepness = cross(directions[:, None], along[None])
        distance = cross(to_start, along[None]) / steepness
        part = cross(to_start, directions[:, None]) / steepness
    hit = (steepness != 0) & (distance >= 0) & (part >= 0) & (part <= 1)
    return np.where(hit, distance, np.inf)


def crossings(segments: Points) -> NDArray[np.intp]:
    """Pairs of segments (S, 4) of which each has its ends on both sides of the other; (X, 2)."""
    found: list[NDArray[np.intp]] = []
    start, end = segments[:, :2], segments[:, 2:]
    for first in range(0, len(segments), 256):
        rows = slice(first, first + 256)
        a, b = start[rows, None], end[rows, None]
        split = cross(b - a, start - a) * cross(b - a, end - a) < 0
        back = cross(end - start, a - start) * cross(end - start, b - start) < 0
        pairs = np.argwhere(split & back) + np.array([first, 0])
        found.append(pairs[pairs[:, 0] < pairs[:, 1]])
    return np.concatenate(found)
