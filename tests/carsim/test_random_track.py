"""Every seed gives a track that can be driven."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.actuators import ActuatorParameters, actuate
from hprs.carsim.collision import touches_wall
from hprs.carsim.drivers import pursue
from hprs.carsim.geometry import curvature, resample
from hprs.carsim.random_track import SMALLEST_RADIUS, random_track
from hprs.carsim.track import advance as advance_on
from hprs.carsim.track import pose_at, progress, stack_tracks
from hprs.carsim.vehicle import VehicleParameters, advance, at_rest
from tests.carsim.tracks import track_of

CAR = VehicleParameters()


@pytest.mark.parametrize("seed", [0, 1, 3, 4, 5, 6])
def test_a_random_track_can_be_driven(seed):
    track = track_of(f"random:{seed}")
    width = np.asarray(track.left + track.right)
    (coarse,) = resample(np.asarray(track.centre, float), 256)
    assert 15.9 <= track.length <= 45.1
    assert width.min() >= 1.2
    assert width.max() <= 2.0
    assert np.abs(curvature(coarse)).max() <= 1.02 / SMALLEST_RADIUS


def test_a_seed_is_a_track():
    np.testing.assert_array_equal(random_track(3).walls, track_of("random:3").walls)
    assert track_of("random:3").length != track_of("random:4").length


@jax.jit
@partial(jax.vmap, in_axes=(0, None))
def drive(track, steps):
    """How far the pursuing driver comes, and whether it ever touched a wall."""

    def control(_, carry):
        car, s, way, touched = carry
        command = pursue(car, s, track)

        def step(_, car):
            inputs = actuate(car, command, mass=CAR.mass, parameters=ActuatorParameters())
            return advance(car, *inputs, parameters=CAR)

        car = jax.lax.fori_loop(0, 10, step, car)
        after = progress(track, car.position, s)
        way += advance_on(track, s, after)
        return car, after, way, touched | touches_wall(track, car)

    start = at_rest(*pose_at(track, jnp.float32(0)))
    carry = start, jnp.float32(0), jnp.float32(0), jnp.bool(False)
    return jax.lax.fori_loop(0, steps, control, carry)[2:]


def test_the_pursuing_driver_laps_random_tracks():
    tracks = stack_tracks([track_of("random:0"), track_of("random:4")])
    way, touched = drive(tracks, 500)
    assert (np.asarray(way) > np.asarray(tracks.length)).all()
    assert not np.asarray(touched).any()
