from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.carsim.actuators import Command
from hprs.carsim.collision import touches_car, touches_wall
from hprs.carsim.designs import load_track
from hprs.carsim.drivers import pursue
from hprs.carsim.leader import follow_the_gap
from hprs.carsim.lidar import BEAMS, beam_angles
from hprs.carsim.packed import layout_of
from hprs.carsim.race import (
    CONTROL_STEP,
    GRID,
    LEAST_GAP,
    Settings,
    World,
    clearance,
    lead_distance,
    reset,
    step,
)
from hprs.carsim.randomisation import ranges
from hprs.carsim.track import Track, pose_at, stack_tracks

NAMES = [(name, reverse) for name in ("gm", "trt", "gm-c") for reverse in (False, True)]
DRIVERS = ("pursuit", "gap", "saturated")
CHUNK = 300


def one(tree, index):
    return jax.tree.map(lambda leaf: leaf[index], tree)


def keys(number, seed=0):
    return jax.random.split(jax.random.key(seed), number)


def straight(steering=0.0, speed=1.5) -> Command:
    return Command(jnp.float32(steering), jnp.float32(speed))


def chosen(world, track, chance, driver) -> Command:
    """The command of one of the DRIVERS; all in one function, so that one compilation serves all tests."""
    flips = jnp.where(
        jax.random.bernoulli(chance, shape=(2,)), jnp.array([1.0, 3.5]), jnp.array([-1.0, 0.0])
    )
    angles = jnp.asarray(beam_angles(), world.scan.dtype)
    commands = [
        pursue(one(world.cars, 0), world.progress[0], track),
        follow_the_gap(world.scan, angles, parameters=world.leader),
        Command(flips[0], flips[1]),
    ]
    return jax.tree.map(lambda *values: jnp.stack(values)[driver], *commands)


def driven(world, track, driver):
    """A world CHUNK control steps later; at each, whether car 0 hit something, its distance and clearance."""

    def control(world, chance):
        world = step(world, track, chosen(world, track, chance, driver))
        return world, (
            world.hit_wall[0] | world.hit_car,
            world.distance[0],
            clearance(world, track)[0],
        )

    chances = jax.random.split(jax.random.wrap_key_data(world.key), CHUNK)
    return jax.lax.scan(control, world, chances)


# Compiled once for all tests.
STEP = jax.jit(step)
RESET_ALL = jax.jit(jax.vmap(jax.vmap(reset, (0, None, None)), (None, 0, None)))
STEP_ALL = jax.jit(jax.vmap(step, (0, 0, None)))
DRIVEN_ALL = jax.jit(jax.vmap(jax.vmap(driven, (0, None, None)), (0, 0, None)))


@pytest.fixture(scope="module")
def all_tracks() -> Track:
    return jax.tree.map(jnp.asarray, stack_tracks([load_track(n, reverse=r) for n, r in NAMES]))


@pytest.fixture(scope="module")
def gm(all_tracks) -> Track:
    # Of the shapes of all the tracks, so that compilations are shared.
    return one(all_tracks, 0)


def worlds_of(tracks, **settings) -> World:
    """100 worlds on each track."""
    return RESET_ALL(keys(100, seed=1), tracks, Settings(**settings))


@pytest.fixture(scope="module")
def worlds(all_tracks) -> World:
    return worlds_of(all_tracks)


@pytest.fixture(scope="module")
def pairs(all_tracks) -> World:
    """Worlds with a leader."""
    return worlds_of(all_tracks, cars=2)


@pytest.fixture(scope="module")
def at_grid(all_tracks) -> World:
    return worlds_of(all_tracks, start="grid", ranges=ranges("nominal"))


@pytest.fixture(scope="module")
def pairs_at_grid(all_tracks) -> World:
    return worlds_of(all_tracks, cars=2, start="grid")


@pytest.mark.parametrize("start", ["random", "grid"])
def test_the_pursuing_driver_laps_every_track_both_ways_from_100_of_100_starts(
    all_tracks, worlds, start
):
    if start == "grid":
        worlds = worlds_of(all_tracks, start="grid")
    _, (hit, distance, clear) = DRIVEN_ALL(worlds, all_tracks, DRIVERS.index("pursuit"))
    assert not np.asarray(hit).any()
    assert np.asarray(clear).min() > 0.3
    assert (np.asarray(distance)[:, :, -1] > np.asarray(all_tracks.length)[:, None]).all()


def test_a_saturated_random_driver_crashes(all_tracks, worlds):
    _, (hit, _, _) = DRIVEN_ALL(worlds, all_tracks, DRIVERS.index("saturated"))
    assert np.asarray(hit)[:, :, -1].all()


def test_the_leader_drives_20_laps_of_gm_c(all_tracks, worlds):
    for _ in range(6):
        worlds, (hit, distance, _) = DRIVEN_ALL(worlds, all_tracks, DRIVERS.index("gap"))
    round_track = slice(4, 6)
    assert not np.asarray(hit)[round_track].any()
    assert (
        np.asarray(distance)[round_track, :, -1]
        > 20 * np.asarray(all_tracks.length)[round_track, None]
    ).all()


def test_the_same_key_gives_the_same_numbers_and_another_one_does_not(all_tracks, worlds):
    first, again = (DRIVEN_ALL(start, all_tracks, 0) for start in (worlds, worlds_of(all_tracks)))
    jax.tree.map(np.testing.assert_array_equal, first, again)
    for leaf in (
        worlds.parameters.vehicle.mass,
        worlds.progress,
        worlds.cars.yaw,
        worlds.scan[..., 0],
    ):
        assert len(np.unique(leaf[0])) == 100


def test_a_leader_that_is_car_1_drives_away_from_a_car_that_waits(all_tracks, pairs):
    batch = jax.tree.map(lambda leaf: leaf[:, 0], pairs)
    gaps = []
    for _ in range(30):
        batch = STEP_ALL(batch, all_tracks, straight(speed=0.0))
        gaps.append(np.asarray(jax.vmap(lead_distance)(batch)))
    assert not np.asarray(batch.hit_wall).any()
    assert not np.asarray(batch.hit_car).any()
    assert (np.diff(gaps, axis=0) <= 1e-4).all()
    np.testing.assert_allclose(gaps[-1], -(batch.gap + batch.distance[:, 1]), atol=1e-3)
    assert np.asarray(batch.distance)[:, 1].min() > 2.5


def test_a_batch_equals_its_worlds_one_by_one(all_tracks, pairs):
    batch = jax.tree.map(lambda leaf: leaf[:, 0], pairs)
    singles = [one(batch, i) for i in range(6)]
    for _ in range(5):
        batch = STEP_ALL(batch, all_tracks, straight(0.3))
        singles = [
            STEP(world, one(all_tracks, i), straight(0.3)) for i, world in enumerate(singles)
        ]
    for i, world in enumerate(singles):
        jax.tree.map(
            partial(np.testing.assert_allclose, rtol=1e-3, atol=2e-4), one(batch, i), world
        )


def test_a_control_step_is_a_tenth_of_a_second(gm, at_grid):
    assert pytest.approx(0.1) == CONTROL_STEP
    world = one(one(at_grid, 0), 0)
    for _ in range(5):
        world = STEP(world, gm, straight())
    before = world.distance[0]
    world = STEP(world, gm, straight())
    assert world.steps == 6
    assert float((world.distance[0] - before) / world.cars.speed[0]) == pytest.approx(0.1, rel=0.05)


def test_a_car_that_touches_a_wall_stands_at_the_step_of_contact(gm, at_grid):
    world = one(one(at_grid, 0), 0)
    for _ in range(40):
        world = STEP(world, gm, straight(1.0, 3.5))
    assert world.hit_wall[0]
    assert touches_wall(gm, one(world.cars, 0))
    after = STEP(world, gm, straight(-1.0, 3.5))
    jax.tree.map(np.testing.assert_array_equal, after.cars, world.cars)
    assert abs(after.distance[0] - world.distance[0]) < 1e-5


def test_cars_that_touch_each_other_stand(gm, pairs_at_grid):
    world = one(one(pairs_at_grid, 0), 0)
    ahead = one(world.cars, 1)
    x = world.cars.x.at[0].set(ahead.x - 0.9 * jnp.cos(ahead.yaw))
    y = world.cars.y.at[0].set(ahead.y - 0.9 * jnp.sin(ahead.yaw))
    yaw = world.cars.yaw.at[0].set(ahead.yaw)
    world = replace(
        world, cars=replace(world.cars, x=x, y=y, yaw=yaw), leader=replace(world.leader, base_speed=0.0, variable_speed=0.0)
    )  # fmt: skip
    world = replace(world, leader_command=straight(speed=0.0))
    for _ in range(10):
        world = STEP(world, gm, straight(speed=3.5))
    assert world.hit_car
    assert touches_car(one(world.cars, 0), one(world.cars, 1))
    assert not world.hit_wall.any()
    after = STEP(world, gm, straight())
    jax.tree.map(np.testing.assert_array_equal, after.cars, world.cars)


def test_a_leader_that_crashed_does_not_stop_the_other_car(gm, pairs_at_grid):
    world = one(one(pairs_at_grid, 0), 0)
    world = replace(world, hit_wall=jnp.array([False, True]))
    after = STEP(world, gm, straight())
    assert after.cars.speed[0] > 0
    assert after.cars.speed[1] == 0


def test_random_starts_are_clear_all_over_the_track_and_head_along_it(all_tracks, pairs):
    worlds = pairs
    clear = jax.jit(jax.vmap(jax.vmap(clearance, (0, None))))(worlds, all_tracks)
    room = (
        jnp.minimum(jnp.min(all_tracks.left, 1), jnp.min(all_tracks.right, 1))
        / all_tracks.max_clearance
    )
    # Near a bend the wall to the side is not the nearest one.
    assert (np.asarray(clear).min(axis=(1, 2)) > np.minimum(0.5, np.asarray(room)) - 0.1).all()
    touching = jax.jit(jax.vmap(jax.vmap(jax.vmap(touches_wall, (None, 0)), (None, 0))))
    assert not np.asarray(touching(all_tracks, worlds.cars)).any()
    share = np.asarray(worlds.progress[..., 0] / all_tracks.length[:, None])
    counts = np.stack([np.histogram(row, bins=5, range=(0, 1))[0] for row in share])
    assert counts.min() > 5
    assert np.asarray(worlds.gap).min() > LEAST_GAP - 0.2
    assert (np.asarray(worlds.gap) < 0.2 * np.asarray(all_tracks.length)[:, None] + 0.3).all()
    ahead = jax.vmap(jax.vmap(jax.vmap(lambda t, s: pose_at(t, s)[2], (None, 0)), (None, 0)))(
        all_tracks, worlds.progress
    )
    turned = np.asarray(worlds.cars.yaw - ahead)
    assert np.abs(np.arctan2(np.sin(turned), np.cos(turned))).max() < 0.3


def test_a_grid_start_is_at_its_places_whatever_the_key_and_the_track(at_grid, pairs_at_grid):
    for worlds, places in ((at_grid, GRID[1]), (pairs_at_grid, GRID[2])):
        for i, (along, _) in enumerate(places):
            np.testing.assert_allclose(worlds.progress[..., i], along, atol=2e-2)
        assert not np.asarray(worlds.cars.speed).any()


def test_readings_are_noisy_as_the_parameters_say(gm, at_grid):
    exact = one(one(at_grid, 0), 0)
    quiet = replace(
        exact.parameters, sensors=jax.tree.map(jnp.zeros_like, exact.parameters.sensors)
    )
    measured = STEP(replace(exact, parameters=quiet), gm, straight())
    noisy = STEP(exact, gm, straight())
    ratio = np.asarray(noisy.scan / measured.scan)
    assert ratio.shape == (BEAMS,)
    assert 0.969 < ratio.min() < 0.98
    assert 1.02 < ratio.max() < 1.031
    assert measured.velocity == measured.cars.speed[0] * jnp.cos(measured.cars.slip[0])
    assert 0 < abs(noisy.velocity - measured.velocity) < 0.1


def test_measured_velocity_is_normal_around_the_true_one(worlds):
    error = np.asarray(worlds.velocity - worlds.cars.speed[..., 0]) / 0.01
    assert abs(error.mean()) < 0.15
    assert 0.9 < error.std() < 1.1
    assert 2.5 < np.abs(error).max() < 5


def test_a_packed_world_steps_as_an_open_one(gm, pairs):
    world = one(one(pairs, 0), 0)
    layout = layout_of(world)

    pack, unpack = jax.jit(layout.pack), jax.jit(layout.unpack)
    packed = pack(world)
    for _ in range(3):
        packed = pack(STEP(unpack(packed), gm, straight(0.2)))
        world = STEP(world, gm, straight(0.2))
    read = layout.read(packed)
    assert isinstance(read, World)
    jax.tree.map(partial(np.testing.assert_allclose, rtol=1e-4, atol=1e-4), read, world)
    np.testing.assert_array_equal(read.key, world.key)


def test_worlds_in_double_precision_stay_in_it(all_tracks):
    with jax.enable_x64(True):
        track = jax.tree.map(
            lambda leaf: (
                np.asarray(leaf, np.float64) if leaf.dtype == np.float32 else np.asarray(leaf)
            ),
            one(all_tracks, 0),
        )
        world = jax.eval_shape(reset, jax.random.key(0), track, Settings(cars=2))
        after = jax.eval_shape(step, world, track, Command(jnp.float64(0.1), jnp.float64(1.0)))
        for before, leaf in zip(jax.tree.leaves(world), jax.tree.leaves(after), strict=True):
            assert leaf.dtype == before.dtype
            assert leaf.dtype != np.float32
