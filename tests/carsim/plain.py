"""What a lidar reads and what a car touches, the slow way: all walls, float64, no trick."""

from __future__ import annotations

import numpy as np

from hprs.carsim.geometry import point_distances

LENGTH, WIDTH, AHEAD, REACH = 0.58, 0.31, 0.04555, 15.0


def corners(pose: np.ndarray, length: float = LENGTH, width: float = WIDTH) -> np.ndarray:
    """Of a car, (4, 2)."""
    x, y, yaw = np.asarray(pose, float)
    along = np.array([np.cos(yaw), np.sin(yaw)]) * length / 2
    aside = np.array([-np.sin(yaw), np.cos(yaw)]) * width / 2
    signs = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
    return np.array([[x, y] + a * along + b * aside for a, b in signs])


def sides(pose: np.ndarray) -> np.ndarray:
    """Of a car, (4, 4)."""
    points = corners(pose)
    return np.concatenate([points, np.roll(points, -1, axis=0)], axis=1)


def readings(
    walls: np.ndarray, poses: np.ndarray, angles: np.ndarray, *, aside: float = 0.0
) -> np.ndarray:
    """Distances from lidars on cars at poses (P, 3) along each beam, (P, B).

    Every wall is met from both of its sides. `aside` moves each beam's start to its left.
    """
    poses = np.asarray(poses, float)
    heading = poses[:, 2:] + angles
    dx, dy = np.cos(heading), np.sin(heading)
    x = poses[:, :1] + AHEAD * np.cos(poses[:, 2:]) - aside * dy
    y = poses[:, 1:2] + AHEAD * np.sin(poses[:, 2:]) + aside * dx
    nearest = np.full(heading.shape, REACH)
    for x0, y0, x1, y1 in np.asarray(walls, float):
        # The wall in axes along the beam: ahead and to the left of it.
        left0, left1 = dx * (y0 - y) - dy * (x0 - x), dx * (y1 - y) - dy * (x1 - x)
        ahead0, ahead1 = dx * (x0 - x) + dy * (y0 - y), dx * (x1 - x) + dy * (y1 - y)
        astride = (left0 * left1 <= 0) & (left0 != left1)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ahead0 + (ahead1 - ahead0) * left0 / (left0 - left1)
        nearest = np.where(astride & (distance >= 0), np.minimum(nearest, distance), nearest)
    return nearest


def gap_to_contact(pose: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Distance from a car's rectangle to each segment, 0 where they share a point; (S,)."""
    points, edges = corners(pose), sides(pose)
    gaps = point_distances(points, segments).min(axis=0)
    ends = segments.reshape(-1, 2)
    gaps = np.minimum(gaps, point_distances(ends, edges).min(axis=1).reshape(-1, 2).min(axis=1))
    x, y, yaw = pose
    turned = (ends - [x, y]) @ np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    inside = (np.abs(turned) <= [LENGTH / 2, WIDTH / 2]).all(axis=1).reshape(-1, 2).any(axis=1)
    for edge in edges:
        inside |= _cross(edge[None], segments)
    return np.where(inside, 0.0, gaps)


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    def turns(segment, point):
        ax, ay, bx, by = segment.T
        return (bx - ax) * (point[:, 1] - ay) - (by - ay) * (point[:, 0] - ax)

    apart = turns(first, second[:, :2]) * turns(first, second[:, 2:]) > 0
    return ~apart & (turns(second, first[:, :2]) * turns(second, first[:, 2:]) <= 0)
