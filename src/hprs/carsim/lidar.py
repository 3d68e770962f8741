"""The lidar: exact distances along beams to the walls that a cell can see, and to other cars.

In the sensor's axes a wall from p to q is met by the beam of direction d if d points between its
ends, and its inverse distance is (d x (q - p)) / (p x q): after one division per wall a beam costs
three cross products per wall, and the nearest wall is the largest inverse distance. Walls have a
front and are seen from there only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from hprs.carsim.body import BODY, Body, outline
from hprs.carsim.track import SIGHT, Track, cell_of
from hprs.carsim.vehicle import Car, VehicleParameters
from hprs.errors import UsageError

BEAMS = 64
"""Beams of the paper's lidar."""
_AHEAD_OF_REAR_AXLE = 0.217
"""Place of the paper's lidar in m."""
_ROUNDINGS = 100
"""Walls are longer by so many units of the last place of 1 m: nothing is seen through a joint."""
_TINY = 1e-30
_TOGETHER = 16
"""Walls that one round of the loop takes; fewer cost more time, more cost compilation."""


@dataclass(frozen=True)
class Lidar:
    """A planar scanner; known when a function that uses it is compiled."""

    beams: int = BEAMS
    """The first points to the left rear, the last to the right rear, as in the paper's code."""
    field_of_view: float = math.radians(270)
    """From the first beam to the last one, rad."""
    reach: float = SIGHT
    """Largest reading in m. A Hokuyo UST-10LX on a real car sees 10 m."""
    ahead: float = _AHEAD_OF_REAR_AXLE - float(VehicleParameters.rear_axle)
    """Of the centre of mass in m."""

    def __post_init__(self) -> None:
        if self.beams < 1:
            raise UsageError(f"A lidar needs at least one beam, not {self.beams}.")
        if not 0 < self.field_of_view <= 2 * math.pi:
            raise UsageError(
                f"A lidar's field of view is above 0 and at most 2 pi, not {self.field_of_view:g}."
            )
        if not 0 < self.reach <= SIGHT:
            raise UsageError(
                f"A lidar's reach is above 0 and at most {SIGHT:g} m, not {self.reach:g}: tracks "
                "list no walls that are further away."
            )


LIDAR = Lidar()
"""The paper's."""


def beam_angles(lidar: Lidar = LIDAR) -> NDArray[np.float64]:
    """Angles of the beams from straight ahead, positive to the left, rad, (beams,)."""
    half = lidar.field_of_view / 2
    return np.linspace(half, -half, lidar.beams)


def measure(
    track: Track,
    car: Car,
    others: Car | None = None,
    *,
    lidar: Lidar = LIDAR,
    body: Body = BODY,
) -> Array:
    """Exact readings of a car's lidar; it sees over its own car.

    Args:
        track: The track.
        car: With its lidar in the free space: from behind, walls are not seen.
        others: What else it sees: a car, or cars with fields (N,).
        lidar: The sensor.
        body: Of the others.

    Returns:
        Distances in m, at most the reach, (beams,). NaN if a pose is: what is seen is unknown.
    """
    cosine, sine = jnp.cos(car.yaw), jnp.sin(car.yaw)
    x, y = car.x + lidar.ahead * cosine, car.y + lidar.ahead * sine
    walls = track.visible[cell_of(track, jnp.stack([x, y]))]
    if others is not None:
        walls = jnp.concatenate([walls, outline(others, body=body).reshape(-1, 4).T], axis=1)

    def turned(x: Array, y: Array) -> tuple[Array, Array]:
        return cosine * x + sine * y, cosine * y - sine * x

    start = turned(walls[0] - x, walls[1] - y)
    end = turned(walls[2] - x, walls[3] - y)
    # Not the difference of the two ends, whose rounding turns short walls that are far away.
    along = turned(walls[2] - walls[0], walls[3] - walls[1])
    angles = beam_angles(lidar)
    directions = (jnp.asarray(each, x.dtype) for each in (np.cos(angles), np.sin(angles)))
    scan = 1 / jnp.maximum(_closeness(start, end, along, *directions), 1 / lidar.reach)
    # A comparison with NaN is false, as with a wall that is not met.
    for unknown in [x + y] + ([] if others is None else [others.x + others.y + others.yaw]):
        scan += 0 * jnp.sum(unknown)
    return scan


def with_noise(scan: Array, uniform: Array, *, share: Array | float, reach: float = SIGHT) -> Array:
    """Readings with multiplicative noise.

    Args:
        scan: Exact distances in m.
        uniform: Numbers in [-1, 1], of the same shape.
        share: Of the distance that the noise reaches, 0.03 in the paper's code.
        reach: Largest reading in m.
    """
    return jnp.minimum(scan * (1 + share * uniform), reach)


def _closeness(
    start: tuple[Array, Array],
    end: tuple[Array, Array],
    along: tuple[Array, Array],
    beam_x: Array,
    beam_y: Array,
) -> Array:
    """Inverse distance to the nearest wall, 0 where there is none.

    Args:
        start: Coordinates of the walls' ends in the sensor's axes, each (K,).
        end: Of their other ends.
        along: From the first ends to the others.
        beam_x: Unit vectors along the beams (B,).
        beam_y: Unit vectors along the beams (B,).

    Returns:
        (B,) 1/m.
    """
    slack = _ROUNDINGS * jnp.finfo(beam_x.dtype).eps
    (x0, y0), (x1, y1), (along_x, along_y) = start, end, along
    area = x0 * along_y - y0 * along_x
    # A wall seen end-on has no distance of its own; its neighbours, longer by the slack, hide it.
    # Only of a sensor that stands on the wall itself, between its ends, is the distance known: 0.
    end_on = slack * jnp.sqrt(jnp.minimum(x0 * x0 + y0 * y0, x1 * x1 + y1 * y1))
    seen = jnp.where(x0 * x1 + y0 * y1 <= 0, area >= -end_on, area > end_on)
    scale = jnp.where(seen, 1 / jnp.maximum(area, _TINY), 0)
    fields = jnp.stack([x0, y0, x1, y1, along_x * scale, along_y * scale])

    def nearer(best: Array, walls: Array) -> tuple[Array, None]:
        for column in range(walls.shape[1]):
            x0, y0, x1, y1, along_x, along_y = walls[:, column]
            before, after = x0 * beam_y - y0 * beam_x, y1 * beam_x - x1 * beam_y
            closeness = beam_x * along_y - beam_y * along_x
            # Selections, not minimum and maximum, which spend as much again on NaN.
            met = jnp.where(before < after, before, after) >= -slack
            closeness = jnp.where(met, closeness, 0)
            best = jnp.where(closeness > best, closeness, best)
        return best, None

    # One reduction over all walls would write every closeness to memory first: ten times slower.
    rest = fields.shape[1] % _TOGETHER
    rounds = jnp.moveaxis(fields[:, rest:].reshape(6, -1, _TOGETHER), 0, 1)
    best, _ = nearer(jnp.zeros_like(beam_x), fields[:, :rest])
    return jax.lax.scan(nearer, best, rounds)[0]
