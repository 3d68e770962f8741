"""Scripted drivers that know the track: references for tests, tasks and pictures."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from hprs.carsim.actuators import MAX_SPEED_COMMAND, STEERING_SCALE, Command
from hprs.carsim.track import Track, pose_at
from hprs.carsim.vehicle import Car, VehicleParameters

_SPACING = 0.25
"""Distance in m between the places ahead at which the driver judges the curvature."""
_PLACES = 14
"""Their number."""
_STRAIGHT = 1e-3
"""Curvature in 1/m below which it allows no more speed."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=[
        "lookahead",
        "top_speed",
        "lateral_acceleration",
        "deceleration",
        "speed_gain",
        "steering_gain",
        "wheelbase",
        "rear_axle",
    ],
    meta_fields=[],
)
@dataclass(frozen=True)
class PursuitParameters:
    """How the pursuing driver drives, and what it takes the car to be.

    It does not know its car's gains; these values suit all of them.
    """

    lookahead: Array | float = 1.3
    """Distance of the point on the line that it steers to, m."""
    top_speed: Array | float = 2.75
    """Speed that it wants on a straight, m/s."""
    lateral_acceleration: Array | float = 1.4
    """What it allows in a bend, m/s^2."""
    deceleration: Array | float = 3.0
    """How it brakes before a bend, m/s^2."""
    speed_gain: Array | float = 1.2
    """Assumed speed over command."""
    steering_gain: Array | float = 0.4
    """Assumed share of the steering scale, below every car's: who turns too little crashes."""
    wheelbase: Array | float = VehicleParameters.front_axle + VehicleParameters.rear_axle
    """m."""
    rear_axle: Array | float = VehicleParameters.rear_axle
    """Its distance from the centre of mass, m."""


def pursue(
    car: Car, s: Array, track: Track, *, parameters: PursuitParameters | None = None
) -> Command:
    """Pure pursuit of the centre line, at a speed that the bends ahead allow.

    The rear axle moves on the circle through a point ahead on the line (R. C. Coulter,
    "Implementation of the Pure Pursuit Path Tracking Algorithm", 1992).

    Args:
        car: Its true state.
        s: Its progress on the track, m.
        track: The track.
        parameters: Of the driver.
    """
    p = parameters or PursuitParameters()
    target = pose_at(track, s + p.lookahead)
    heading = jnp.stack([jnp.cos(car.yaw), jnp.sin(car.yaw)])
    to_target = target[:2] - (car.position - p.rear_axle * heading)
    sideways = heading[0] * to_target[1] - heading[1] * to_target[0]
    curvature = 2 * sideways / jnp.maximum(jnp.sum(to_target**2), p.lookahead**2 / 4)
    angle = jnp.arctan(p.wheelbase * curvature)
    steering = jnp.clip(angle / (STEERING_SCALE * p.steering_gain), -1.0, 1.0)
    turning = jnp.sqrt(p.lateral_acceleration / jnp.maximum(jnp.abs(curvature), _STRAIGHT))
    allowed = jnp.minimum(turning, _allowed_speed(s, track, p))
    wanted = jnp.minimum(p.top_speed, allowed) / p.speed_gain
    return Command(steering, jnp.clip(wanted, 0.0, MAX_SPEED_COMMAND).astype(steering.dtype))


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["pursuit", "distance", "eagerness"],
    meta_fields=[],
)
@dataclass(frozen=True)
class FollowParameters:
    """How the following driver drives."""

    pursuit: PursuitParameters = field(
        default_factory=lambda: PursuitParameters(top_speed=3.2, lateral_acceleration=4.5)
    )
    """Of the centre line; its speed is the limit while the driver catches up."""
    distance: Array | float = 1.75
    """To the leader along the track, m; the middle of what the task asks for."""
    eagerness: Array | float = 2.0
    """Speed in m/s that it adds to the leader's for a metre too much."""


def follow(
    car: Car,
    s: Array,
    track: Track,
    *,
    behind: Array,
    leader_speed: Array,
    parameters: FollowParameters | None = None,
) -> Command:
    """Pursues the centre line and keeps its distance from a leader.

    Args:
        car: Its true state.
        s: Its progress on the track, m.
        track: The track.
        behind: From the car forwards to the leader along the track, m.
        leader_speed: m/s.
        parameters: Of the driver.
    """
    p = parameters or FollowParameters()
    command = pursue(car, s, track, parameters=p.pursuit)
    wanted = leader_speed + p.eagerness * (behind - p.distance)
    speed = jnp.clip(wanted / p.pursuit.speed_gain, 0.0, command.speed)
    return replace(command, speed=speed.astype(command.speed.dtype))


def _allowed_speed(s: Array, track: Track, p: PursuitParameters) -> Array:
    """Largest speed in m/s from which every bend ahead can still be taken."""
    distance = _SPACING * jnp.arange(_PLACES + 1, dtype=s.dtype)
    yaw = jax.vmap(lambda ahead: pose_at(track, s + ahead)[2])(distance)
    turn = jnp.diff(yaw)
    # The shorter way round.
    turn = jnp.arctan2(jnp.sin(turn), jnp.cos(turn))
    curvature = jnp.maximum(jnp.abs(turn) / _SPACING, _STRAIGHT)
    bend = p.lateral_acceleration / curvature
    return jnp.sqrt(jnp.min(bend + 2 * p.deceleration * distance[:-1]))
