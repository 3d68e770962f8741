from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.actuators import MAX_SPEED_COMMAND, actuate
from hprs.carsim.drivers import FollowParameters, follow, pursue
from hprs.carsim.randomisation import ranges, sample
from hprs.carsim.track import POINTS, Track, pose_at, progress
from hprs.carsim.vehicle import advance, at_rest


def ring(radius: float, *, clockwise: bool = False) -> Track:
    """A round track without walls."""
    angles = np.linspace(0, 2 * np.pi, POINTS, endpoint=False) * (-1 if clockwise else 1)
    centre = radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    width = jnp.full(POINTS, 0.7)
    lists = jnp.zeros((1, 1), jnp.int32)
    return Track(
        centre=jnp.asarray(centre, jnp.float32), left=width, right=width, length=jnp.float32(2 * np.pi * radius),
        max_clearance=jnp.float32(0.7), walls=jnp.full((1, 4), 1e5), origin=jnp.zeros(2), columns=jnp.int32(1),
        visible=lists, near=lists, closest=lists,
    )  # fmt: skip


@partial(jax.jit, static_argnames="steps")
def offsets(key, track, steps=300):
    """Distance from a ring's centre and speed at every control step."""
    place, chance = jax.random.split(key)
    parameters = sample(chance, ranges())
    s = jax.random.uniform(place) * track.length
    car = at_rest(*pose_at(track, s, 0.2))

    def control(carry, _):
        car, s = carry
        command = pursue(car, s, track)

        def step(_, car):
            inputs = actuate(
                car, command, mass=parameters.vehicle.mass, parameters=parameters.actuators
            )
            return advance(car, *inputs, parameters=parameters.vehicle)

        car = jax.lax.fori_loop(0, 10, step, car)
        s = progress(track, car.position, s)
        return (car, s), (jnp.hypot(car.x, car.y), car.speed, command.speed)

    return jax.lax.scan(control, (car, s), length=steps)[1]


@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("radius", [2.15, 3.0])
def test_every_randomised_car_stays_near_the_middle_of_a_ring(radius, clockwise):
    keys = jax.random.split(jax.random.key(0), 50)
    distance, speed, command = jax.vmap(offsets, (0, None))(keys, ring(radius, clockwise=clockwise))
    assert np.abs(np.asarray(distance) - radius).max() < 0.4
    assert np.asarray(speed)[:, 50:].min() > 1.0
    assert 0 <= command.min() <= command.max() <= MAX_SPEED_COMMAND


@pytest.mark.parametrize(
    ("behind", "speed"),
    [
        (1.75, 1.5),  # The leader's, where the distance is what it shall be.
        (1.25, 0.5),
        (0.75, 0.0),  # It stands rather than to drive backwards.
        (9.0, None),  # What a bend allows is the limit.
    ],
)
def test_a_follower_drives_at_its_leaders_speed_and_corrects_the_distance(behind, speed):
    track, s = ring(3.0), jnp.float32(2.0)
    car, parameters = at_rest(*pose_at(track, s)), FollowParameters()
    found = follow(car, s, track, behind=jnp.float32(behind), leader_speed=jnp.float32(1.5))
    pursued = pursue(car, s, track, parameters=parameters.pursuit)
    assert found.steering == pursued.steering
    assert found.speed.dtype == jnp.float32
    expected = pursued.speed if speed is None else speed / parameters.pursuit.speed_gain
    np.testing.assert_allclose(found.speed, expected, rtol=1e-6)
