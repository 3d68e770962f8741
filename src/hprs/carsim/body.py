"""The outline of a car: a rectangle that its walls, its lidar and other cars know it by."""

from __future__ import annotations

import math
from dataclasses import dataclass

import jax.numpy as jnp
from jax import Array

from hprs.carsim.track import BODY_REACH
from hprs.carsim.vehicle import Car
from hprs.errors import UsageError


@dataclass(frozen=True)
class Body:
    """Size of a car's rectangle, whose middle is the centre of mass; known when one compiles."""

    length: float = 0.58
    """m (F1TENTH)."""
    width: float = 0.31
    """m (F1TENTH)."""

    def __post_init__(self) -> None:
        reach = math.hypot(self.length, self.width) / 2
        if not (min(self.length, self.width) > 0 and reach <= BODY_REACH):
            raise UsageError(
                f"A body of {self.length:g} m x {self.width:g} m does not suit the tracks: both "
                f"sides must be above 0 and the corners within {BODY_REACH:g} m of the middle."
            )


BODY = Body()
"""The F1TENTH car's."""


def outline(car: Car, *, body: Body = BODY) -> Array:
    """Sides of a car's rectangle as walls with the free space on their left, around it.

    Args:
        car: Fields () or (N,).
        body: Of all the cars.

    Returns:
        Segments x0, y0, x1, y1 in m, (4, 4) or (N, 4, 4).
    """
    cosine, sine = jnp.cos(car.yaw)[..., None], jnp.sin(car.yaw)[..., None]
    ahead = jnp.asarray([1.0, 1.0, -1.0, -1.0], car.x.dtype) * (body.length / 2)
    aside = jnp.asarray([1.0, -1.0, -1.0, 1.0], car.x.dtype) * (body.width / 2)
    x = car.x[..., None] + cosine * ahead - sine * aside
    y = car.y[..., None] + sine * ahead + cosine * aside
    return jnp.stack([x, y, jnp.roll(x, -1, axis=-1), jnp.roll(y, -1, axis=-1)], axis=-1)
