"""Lost scans, a speed that is off, and commands that are obeyed late, in the running simulator."""

from __future__ import annotations

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.actuators import STEPS_PER_COMMAND, Command
from hprs.carsim.designs import load_track
from hprs.carsim.faults import FAULTS, Faults, faulty_scan, faulty_speed
from hprs.carsim.race import Settings, reset, step
from hprs.carsim.randomisation import narrowed, ranges

STEPS = 8
SPEEDS = (1.0, 2.0, 0.5, 3.0, 1.5, 2.5, 0.0, 1.0)
STEERINGS = (0.2, -0.5, 0.1, 0.0, 0.4, -0.2, 0.3, 0.0)


@jax.jit
def driven(track, settings):
    """A world at its reset and after each of some commands."""
    first = reset(jax.random.key(3), track, settings)

    def control(world, command):
        world = step(world, track, command, faults=settings.faults)
        return world, world

    commands = Command(jnp.array(STEERINGS), jnp.array(SPEEDS))
    _, later = jax.lax.scan(control, first, commands)
    return jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), first, later)


@cache
def episode(**given):
    track = jax.tree.map(jnp.asarray, load_track("gm", dtype=np.float32))
    delay = given.pop("delay", 0.0)
    within = narrowed(ranges("nominal"), {"delay": (delay, delay)})
    faults = jax.tree.map(jnp.float32, Faults(**given))
    return driven(track, Settings(start="grid", ranges=within, faults=faults))


@cache
def faultless():
    track = jax.tree.map(jnp.asarray, load_track("gm", dtype=np.float32))
    return driven(track, Settings(start="grid", ranges=narrowed(ranges("nominal"), {})))


def test_a_lost_scan_is_the_one_before():
    now, before = jnp.array([1.0, 2.0]), jnp.array([3.0, 4.0])
    faults = Faults(dropped_scans=0.25)
    assert faulty_scan(now, before, uniform=jnp.float32(0.2), faults=faults).tolist() == [3, 4]
    assert faulty_scan(now, before, uniform=jnp.float32(0.25), faults=faults).tolist() == [1, 2]


def test_the_speed_is_scaled_then_shifted():
    assert float(faulty_speed(jnp.float32(2.0), Faults(speed_scale=1.5, speed_offset=-0.25))) == 2.75


def test_the_table_names_the_fields_and_their_neutral_values():
    assert {fault.name: fault.neutral for fault in FAULTS} == vars(Faults())
    for fault in FAULTS:
        assert list(fault.tested) == sorted(fault.tested)
        assert fault.neutral in fault.tested
        assert fault.least <= fault.tested[0] < fault.tested[-1] <= fault.greatest


def test_neutral_faults_change_no_bit_of_an_episode():
    jax.tree.map(np.testing.assert_array_equal, episode(), faultless())


def test_a_car_whose_every_scan_is_lost_sees_its_first_one_for_ever():
    world = episode(dropped_scans=1.0)
    assert np.array_equal(world.scan, np.tile(world.scan[0], (STEPS + 1, 1)))
    assert np.array_equal(world.scan[0], faultless().scan[0])
    # It is driven as before: only what it sees has changed.
    assert np.array_equal(world.cars.x, faultless().cars.x)


def test_scans_are_lost_as_often_as_asked_and_each_repeats_what_arrived_before():
    usual, world = faultless().scan, episode(dropped_scans=0.5).scan
    fresh = [np.array_equal(world[i], usual[i]) for i in range(1, STEPS + 1)]
    stale = [np.array_equal(world[i], world[i - 1]) for i in range(1, STEPS + 1)]
    assert 0 < sum(stale) < STEPS
    assert [not one for one in fresh] == stale


def test_a_biased_speed_is_measured_from_the_reset_on():
    world = episode(speed_scale=2.0, speed_offset=0.5)
    np.testing.assert_allclose(world.velocity, 2 * faultless().velocity + 0.5, rtol=1e-6)
    assert np.array_equal(world.cars.speed, faultless().cars.speed)


@pytest.mark.parametrize("periods", [1, 2])
def test_a_latency_of_n_control_periods_delays_what_the_car_does_by_n(periods):
    late = episode(delay=float(periods * STEPS_PER_COMMAND))
    usual = faultless()
    # The car stands until the first command arrives, and then does what it would have done.
    for name in ("x", "y", "yaw", "speed", "steering"):
        moved, expected = getattr(late.cars, name), getattr(usual.cars, name)
        assert np.array_equal(moved[: periods + 1], np.tile(expected[0], (periods + 1, 1)))
        np.testing.assert_allclose(moved[periods:], expected[: STEPS + 1 - periods], atol=1e-6)
    assert float(jnp.abs(usual.cars.x[-1] - late.cars.x[-1]).max()) > 0.01
