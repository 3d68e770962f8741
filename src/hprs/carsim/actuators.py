"""Motor and steering: from a command to the car's acceleration and steering rate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from jax import Array

from hprs.carsim.vehicle import TIME_STEP, Car

MAX_SPEED_COMMAND = 3.5
"""m/s; with the gain the car itself reaches up to 5 m/s."""
STEERING_SCALE = 0.42
"""Angle in rad of a normalised steering command of 1, before the gain."""
STEERING_LIMIT = 0.4189
"""Largest angle of the front wheels in rad (F1TENTH)."""
STEERING_RATE = 3.2
"""Largest steering rate in rad/s (F1TENTH)."""
STEPS_PER_COMMAND = 10
"""Simulation steps during which one command holds: 10 Hz."""
REMEMBERED = 4
"""Commands that are kept, the newest included."""
MAX_DELAY = STEPS_PER_COMMAND * (REMEMBERED - 1)
"""Largest delay of a command in simulation steps."""


@partial(jax.tree_util.register_dataclass, data_fields=["steering", "speed"], meta_fields=[])
@dataclass(frozen=True)
class Command:
    """What a driver asks for."""

    steering: Array
    """Normalised to [-1, 1], positive to the left (REP 103; the paper's code had it to the
    right)."""
    speed: Array
    """m/s in [0, 3.5]."""


@partial(
    jax.tree_util.register_dataclass,
    data_fields=[
        "speed_gain",
        "steering_gain",
        "steering_offset",
        "motor_time",
        "steering_time",
        "max_force",
        "delay",
    ],
    meta_fields=[],
)
@dataclass(frozen=True)
class ActuatorParameters:
    """What lies between a command and the car."""

    speed_gain: Array | float = 1.1
    """Speed reached over speed commanded; 22 rad/s per m/s on wheels of 0.05 m."""
    steering_gain: Array | float = 0.5
    """Share of `STEERING_SCALE` that a command of 1 reaches."""
    steering_offset: Array | float = 0.0
    """Angle in rad of a command of 0."""
    motor_time: Array | float = 0.1
    """Time constant of the speed controller, s."""
    steering_time: Array | float = 0.05
    """Time constant of the steering servo, s."""
    max_force: Array | float = 35.6
    """Of the motor and of the brakes, N; 9.51 m/s^2 of the nominal mass (F1TENTH)."""
    delay: Array | int = 0
    """Simulation steps from a command to its effect, at most `MAX_DELAY`."""


def actuate(
    car: Car,
    command: Command,
    *,
    mass: Array | float,
    parameters: ActuatorParameters,
    time_step: float | Array = TIME_STEP,
) -> tuple[Array, Array]:
    """Acceleration (m/s^2) and steering rate (rad/s) that hold for one step.

    Both actuators approach their target as first-order systems, solved exactly over the step, with
    a limit on the rate.

    Args:
        car: The state.
        command: In force during the step; what is out of range is clipped.
        mass: Of the car, kg.
        parameters: Of the actuators.
        time_step: s.
    """
    p = parameters
    speed = jnp.clip(command.speed, 0.0, MAX_SPEED_COMMAND) * p.speed_gain
    angle = jnp.clip(command.steering, -1.0, 1.0) * STEERING_SCALE * p.steering_gain
    angle = jnp.clip(angle + p.steering_offset, -STEERING_LIMIT, STEERING_LIMIT)
    acceleration = _approach(speed - car.speed, p.motor_time, time_step)
    steering_rate = _approach(angle - car.steering, p.steering_time, time_step)
    limit = p.max_force / mass
    return (
        jnp.clip(acceleration, -limit, limit),
        jnp.clip(steering_rate, -STEERING_RATE, STEERING_RATE),
    )


def _approach(distance: Array, time: Array | float, time_step: float | Array) -> Array:
    return distance * (-jnp.expm1(-time_step / time) / time_step)


@partial(jax.tree_util.register_dataclass, data_fields=["commands"], meta_fields=[])
@dataclass(frozen=True)
class DelayLine:
    """The last commands, for an actuator that obeys late."""

    commands: Command
    """Fields (REMEMBERED,), the newest first."""


def idle(dtype: jnp.dtype = jnp.float32) -> DelayLine:
    """A delay line of a car that was told to stand."""
    zeros = jnp.zeros(REMEMBERED, dtype)
    return DelayLine(Command(zeros, zeros))


def pushed(line: DelayLine, command: Command) -> DelayLine:
    """The delay line at the start of a control step with a new command."""
    return jax.tree.map(
        lambda old, new: jnp.concatenate([jnp.atleast_1d(new).astype(old.dtype), old[:-1]]),
        line,
        DelayLine(command),
    )


def in_force(line: DelayLine, step: Array | int, *, delay: Array | int) -> Command:
    """The command that reaches the actuators.

    Args:
        line: After the newest command was `pushed`.
        step: Simulation steps since then, from 0 to `STEPS_PER_COMMAND` - 1.
        delay: Simulation steps, at most `MAX_DELAY`.
    """
    # Ceiling division: a delay of 1 to 10 steps reaches back to the command before at step 0.
    age = (delay - step + STEPS_PER_COMMAND - 1) // STEPS_PER_COMMAND
    age = jnp.clip(age, 0, REMEMBERED - 1)
    return jax.tree.map(lambda kept: kept[age], line.commands)
