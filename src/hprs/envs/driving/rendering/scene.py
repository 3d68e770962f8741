"""What is seen of an episode, as plain numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hprs.envs.driving.simulation import Episode


@dataclass(frozen=True)
class Scene:
    """A moment of an episode with N cars; car 0 is the one that learns."""

    poses: NDArray[np.float64]
    """Centres of mass and headings x, y, yaw of the cars, (N, 3), m and rad."""
    wheels: NDArray[np.float64]
    """Angles of the front wheels, positive to the left, (N,), rad."""
    scan: NDArray[np.float64]
    """Readings of the lidar of car 0, from the left rear to the right rear, (B,), m."""
    reach: float
    """What a reading without a wall is, m."""
    trail: NDArray[np.float64]
    """Where the cars were before, the oldest first, (T, N, 2), m."""
    speed: float
    """Forwards, m/s."""
    steering: float
    """The steering command, in [-1, 1], positive to the left."""
    progress: float
    """Driven of a lap."""
    lead: float | None
    """Distance along the track to the leader, m; None without one."""
    hit_wall: bool
    """Whether car 0 has touched a wall."""
    hit_car: bool
    """Whether the cars have touched."""


def scene_of(episodes: Sequence[Episode], *, length: float, reach: float) -> Scene:
    """The last of some consecutive states of one episode, in NumPy, and a trail of all of them.

    Args:
        episodes: At least one.
        length: Of the track, m.
        reach: Of the lidar, m.
    """
    episode = episodes[-1]
    world, cars = episode.world, episode.world.cars
    trail = [np.stack([e.world.cars.x, e.world.cars.y], axis=-1) for e in episodes]
    behind = float(world.gap + world.distance[-1] - world.distance[0])
    return Scene(
        poses=np.stack([cars.x, cars.y, cars.yaw], axis=-1).astype(float),
        wheels=np.asarray(cars.steering, float),
        scan=np.asarray(episode.scans[-1], float),
        reach=reach,
        trail=np.asarray(trail, float),
        speed=float(cars.speed[0] * np.cos(cars.slip[0])),
        steering=float(episode.commands[-1, 0]),
        progress=float(world.distance[0]) / length,
        lead=behind if len(cars.x) == 2 else None,
        hit_wall=bool(world.hit_wall[0]),
        hit_car=bool(world.hit_car),
    )
