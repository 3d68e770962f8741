from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.actuators import (
    MAX_DELAY,
    STEERING_LIMIT,
    STEERING_RATE,
    STEPS_PER_COMMAND,
    ActuatorParameters,
    Command,
    actuate,
    idle,
    in_force,
    pushed,
)
from hprs.carsim.vehicle import TIME_STEP, VehicleParameters, advance, at_rest

NOMINAL = ActuatorParameters()
VEHICLE = VehicleParameters()


def driven(command, parameters=NOMINAL, steps=300):
    def step(car, _):
        inputs = actuate(car, command, mass=VEHICLE.mass, parameters=parameters)
        car = advance(car, *inputs, parameters=VEHICLE)
        return car, (car.speed, car.steering)

    zero = jnp.float32(0)
    _, series = jax.jit(lambda car: jax.lax.scan(step, car, length=steps))(
        at_rest(zero, zero, zero)
    )
    return np.asarray(series)


def command(steering, speed):
    return Command(jnp.float32(steering), jnp.float32(speed))


@pytest.mark.parametrize(("gain", "expected"), [(1.0, 3.5), (1.1, 3.85), (1.4286, 5.0)])
def test_the_speed_reached_is_the_command_times_the_gain(gain, expected):
    speed, _ = driven(command(0.0, 9.0), ActuatorParameters(speed_gain=gain))
    assert speed[-1] == pytest.approx(expected, rel=1e-3)


def test_acceleration_ends_at_the_motors_force():
    speed, _ = driven(command(0.0, 3.5))
    assert np.diff(speed, prepend=0).max() / TIME_STEP == pytest.approx(
        NOMINAL.max_force / VEHICLE.mass, rel=1e-3
    )


def test_a_small_step_of_speed_is_a_first_order_response():
    speed, _ = driven(command(0.0, 0.5))
    time = TIME_STEP * np.arange(1, 301)
    np.testing.assert_allclose(speed, 0.55 * (1 - np.exp(-time / NOMINAL.motor_time)), atol=1e-5)


@pytest.mark.parametrize("sign", [-1, 1])
def test_full_steering_is_the_scale_times_the_gain_positive_to_the_left(sign):
    _, angle = driven(command(3.0 * sign, 0.0))
    assert angle[-1] == pytest.approx(0.21 * sign, rel=1e-3)
    assert np.abs(np.diff(angle, prepend=0)).max() / TIME_STEP <= STEERING_RATE * 1.001


def test_the_offset_moves_the_wheels_and_the_stop_limits_them():
    _, angle = driven(command(0.0, 0.0), ActuatorParameters(steering_offset=0.02))
    assert angle[-1] == pytest.approx(0.02, rel=1e-3)
    _, angle = driven(command(1.0, 0.0), ActuatorParameters(steering_gain=1.0, steering_offset=0.1))
    assert angle[-1] == pytest.approx(STEERING_LIMIT, rel=1e-3)


@pytest.mark.parametrize("delay", [0, 1, 5, 10, 13, MAX_DELAY])
def test_a_command_takes_effect_after_its_delay(delay):
    given = np.arange(1.0, 7.0, dtype=np.float32)
    line, seen = idle(), []
    for value in given:
        line = pushed(line, command(-value, value))
        for step in range(STEPS_PER_COMMAND):
            now = in_force(line, step, delay=jnp.int32(delay))
            assert now.steering == -now.speed
            seen.append(float(now.speed))
    undelayed = np.repeat(given, STEPS_PER_COMMAND)
    expected = np.concatenate([np.zeros(delay), undelayed])[: len(undelayed)]
    np.testing.assert_array_equal(seen, expected)
