"""Contact of a car with walls and with other cars, by separating axes: exact at one moment.

It is tested at every simulation step, in which a car moves by 5 cm at most. Nothing is driven
through in between: bodies of two steps that are less than a body's width (31 cm) apart share a
point, so a body that was in the free space and touches no wall is still in the free space. What
can be missed is a corner that a corner touches for less than a step.
"""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from hprs.carsim.body import BODY, Body
from hprs.carsim.track import Track, cell_of
from hprs.carsim.vehicle import Car


def touches_wall(track: Track, car: Car, *, body: Body = BODY) -> Array:
    """Whether a car's rectangle and a wall share a point, () bool; true of a pose that is NaN.

    Args:
        track: The track.
        car: Its centre is in the free space: the walls around it are listed by cell for such.
        body: Of the car.
    """
    walls = track.near[cell_of(track, car.position)]
    return ~jnp.all(_is_clear(walls, car, body))


def touches_car(car: Car, other: Car, *, body: Body = BODY) -> Array:
    """Whether the rectangles of two cars share a point, bool of the fields' shape; true of NaN.

    Args:
        car: One car.
        other: Another one.
        body: Of both.
    """
    along, across = body.length / 2, body.width / 2
    turn = other.yaw - car.yaw
    cosine, sine = jnp.abs(jnp.cos(turn)), jnp.abs(jnp.sin(turn))
    # Half of what the other rectangle measures along the axes of the first one, and vice versa.
    longest = along + along * cosine + across * sine
    widest = across + along * sine + across * cosine
    apart = [
        (jnp.abs(ahead) > longest) | (jnp.abs(aside) > widest)
        for ahead, aside in (_seen_from(car, other.x, other.y), _seen_from(other, car.x, car.y))
    ]
    return ~(apart[0] | apart[1])


def _is_clear(walls: Array, car: Car, body: Body) -> Array:
    """Which walls (4, M) keep off a car's rectangle; (M,). Of NaN none does: it proves nothing."""
    along, across = body.length / 2, body.width / 2
    x0, y0 = _seen_from(car, walls[0], walls[1])
    x1, y1 = _seen_from(car, walls[2], walls[3])
    middle_x, middle_y = (x0 + x1) / 2, (y0 + y1) / 2
    half_x, half_y = (x1 - x0) / 2, (y1 - y0) / 2
    lever = jnp.abs(middle_x * half_y - middle_y * half_x)
    half_x, half_y = jnp.abs(half_x), jnp.abs(half_y)
    return (
        (jnp.abs(middle_x) > along + half_x)
        | (jnp.abs(middle_y) > across + half_y)
        | (lever > along * half_y + across * half_x)
    )


def _seen_from(car: Car, x: Array, y: Array) -> tuple[Array, Array]:
    """A place in a car's axes: ahead of its centre and to the left of it, m."""
    cosine, sine = jnp.cos(car.yaw), jnp.sin(car.yaw)
    x, y = x - car.x, y - car.y
    return cosine * x + sine * y, cosine * y - sine * x
