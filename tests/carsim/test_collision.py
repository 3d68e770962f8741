"""Contact of cars with walls and with each other, against brute force and against known places."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hprs.carsim import track as tracks
from hprs.carsim.body import BODY, Body, outline
from hprs.carsim.collision import touches_car, touches_wall
from hprs.carsim.designs import load_track
from hprs.carsim.geometry import cross, inside
from hprs.carsim.vehicle import Car, at_rest
from hprs.errors import UsageError
from tests.carsim import plain
from tests.carsim.tracks import NAMES, padded, track_of, walls_of

CONTACT = 1e-4
"""m; closer than this to the moment of contact, either answer is right."""
at_walls = jax.jit(jax.vmap(touches_wall, (None, 0)))
cars_touch = jax.jit(jax.vmap(touches_car))


def cars_at(poses) -> Car:
    return at_rest(*jnp.asarray(np.asarray(poses).T))


def car_at(*pose: float) -> Car:
    return at_rest(*jnp.asarray(pose, jnp.float32))


def poses_on(name: str, number: int, seed: int = 0) -> np.ndarray:
    """Cars with their centres in the free space, many of them at walls."""
    track, generator = padded(name), np.random.default_rng(seed)
    index = generator.integers(tracks.POINTS, size=number)
    left, right = np.asarray(track.left)[index], np.asarray(track.right)[index]
    s = index / tracks.POINTS * float(track.length)
    x, y, _ = jax.vmap(partial(tracks.pose_at, track))(s, generator.uniform(-right, left)).T
    poses = np.column_stack([x, y, generator.uniform(-4, 4, number)]).astype(np.float32)
    return poses[inside(poses[:, :2].astype(float), walls_of(name))]


def grown(pose: np.ndarray, by: float) -> np.ndarray:
    """Corners of a car's rectangle that is larger by a margin on every side."""
    return plain.corners(pose, plain.LENGTH + 2 * by, plain.WIDTH + 2 * by)


def overlap(first: np.ndarray, second: np.ndarray) -> bool:
    """Of two convex shapes given by their corners, by all separating axes."""
    for shape in (first, second):
        for along in np.roll(shape, -1, axis=0) - shape:
            one, two = cross(along, first), cross(along, second)
            if one.max() < two.min() or two.max() < one.min():
                return False
    return True


@pytest.mark.parametrize("name", NAMES)
def test_contact_with_walls_is_that_of_the_rectangle(name):
    poses = poses_on(name, 1500)
    found = np.asarray(at_walls(padded(name), cars_at(poses)))
    gaps = np.array([plain.gap_to_contact(pose, walls_of(name)).min() for pose in poses])
    assert not found[gaps > CONTACT].any()
    # Cars that touch by less than the margin may be missed: smaller by it, they touch nothing.
    for pose in poses[(gaps == 0) & ~found]:
        smaller = grown(pose, -CONTACT)
        assert not any(overlap(smaller, wall.reshape(2, 2)) for wall in walls_of(name))
    assert 0.2 < found.mean() < 0.8


@pytest.mark.parametrize("yaw", [0.0, np.pi / 2, np.pi / 6, -2.0])
def test_contact_begins_where_the_outline_reaches_the_wall(yaw):
    track = padded("gm")
    reach = abs(np.sin(yaw)) * BODY.length / 2 + abs(np.cos(yaw)) * BODY.width / 2
    start, end = long_wall(track)
    for gap, expected in [(1e-3, False), (-1e-3, True)]:
        direction = (end - start) / np.hypot(*(end - start))
        normal = np.array([-direction[1], direction[0]])
        place = (start + end) / 2 + (reach + gap) * normal
        heading = np.arctan2(direction[1], direction[0]) + yaw
        assert bool(touches_wall(track, car_at(*place, heading))) is expected


def long_wall(track) -> np.ndarray:
    """Its beginning and its end."""
    walls = np.asarray(track.walls, float)
    long = np.hypot(walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]) > 0.8
    return walls[long][0].reshape(2, 2)


@pytest.mark.parametrize("name", ["gm", "gm-c"])
def test_no_car_gets_through_a_wall_at_full_speed(name):
    # 5 m/s in every direction, 5 cm a step, turning at up to 10 rad/s.
    poses = poses_on(name, 2000, seed=1)
    track, cars = padded(name), cars_at(poses)
    poses = poses[~np.asarray(at_walls(track, cars))]
    generator = np.random.default_rng(2)
    course = generator.uniform(-np.pi, np.pi, len(poses)).astype(np.float32)
    spin = generator.uniform(-10, 10, len(poses)).astype(np.float32)
    cars = cars_at(poses)
    hit = np.zeros(len(poses), bool)
    for _ in range(400):
        moved = replace(
            cars,
            x=cars.x + 0.05 * np.cos(course),
            y=cars.y + 0.05 * np.sin(course),
            yaw=cars.yaw + 0.01 * spin,
        )
        cars = jax.tree.map(partial(jnp.where, hit), cars, moved)
        hit |= np.asarray(at_walls(track, cars))
    assert hit.all()
    assert inside(np.stack([cars.x, cars.y], axis=1).astype(float), walls_of(name)).all()


coordinates = st.floats(-1, 1, width=32)
headings = st.floats(-7, 7, width=32)


@settings(max_examples=300, deadline=None)
@given(coordinates, coordinates, headings, headings)
def test_contact_of_two_cars_is_that_of_their_rectangles(x, y, yaw, other_yaw):
    first, second = (3.0, -2.0, yaw), (3.0 + x, -2.0 + y, other_yaw)
    found = bool(one_contact(car_at(*first), car_at(*second)))
    assert found == bool(one_contact(car_at(*second), car_at(*first)))
    if found:
        assert overlap(grown(first, CONTACT), grown(second, CONTACT))
    else:
        assert not overlap(grown(first, -CONTACT), grown(second, -CONTACT))


one_contact = jax.jit(touches_car)


@pytest.mark.parametrize(
    ("place", "reach"),
    [
        ((1.0, 0.0, 0.0), 0.58),
        ((0.0, 1.0, 0.0), 0.31),
        ((1.0, 0.0, np.pi / 2), 0.29 + 0.155),
        ((0.0, 1.0, np.pi / 2), 0.29 + 0.155),
        ((1.0, 0.0, np.pi), 0.58),
    ],
)
def test_two_cars_touch_at_known_distances(place, reach):
    x, y, yaw = place
    for distance, expected in [(reach + 1e-3, False), (reach - 1e-3, True)]:
        other = car_at(x * distance, y * distance, yaw)
        assert bool(touches_car(car_at(0.0, 0.0, 0.0), other)) is expected


def test_two_cars_do_not_pass_through_each_other_head_on():
    # 10 m/s towards each other, at every offset at which they meet for more than a step.
    for offset in np.linspace(-0.3, 0.3, 7):
        steps = np.arange(60) * 0.05
        zero = np.zeros(60)
        left = cars_at(np.column_stack([-1.5 + steps, zero, zero]).astype(np.float32))
        right = cars_at(np.column_stack([1.5 - steps, zero + offset, zero]).astype(np.float32))
        assert cars_touch(left, right).any()


def test_the_outline_faces_away_from_the_car():
    pose = (1.0, 2.0, 0.7)
    walls = np.asarray(outline(car_at(*pose)), float)
    np.testing.assert_allclose(walls, plain.sides(pose), atol=1e-6)
    to_car = np.array(pose[:2]) - walls[:, :2]
    assert (cross(walls[:, 2:] - walls[:, :2], to_car) < 0).all()
    several = outline(cars_at(np.array([pose, (0.0, 0.0, 0.0)], np.float32)))
    np.testing.assert_allclose(several[0], walls, atol=1e-6)


def test_another_body_touches_at_its_own_size():
    body = Body(length=0.4, width=0.2)
    other = car_at(0.45, 0.0, 0.0)
    assert touches_car(car_at(0.0, 0.0, 0.0), other)
    assert not touches_car(car_at(0.0, 0.0, 0.0), other, body=body)


def test_a_batch_of_tracks_a_loop_and_single_calls_agree():
    batch = tracks.stack_tracks([track_of(name) for name in NAMES])
    poses = np.stack([poses_on(name, 200)[:40] for name in NAMES])
    cars = at_rest(*jnp.moveaxis(jnp.asarray(poses), -1, 0))
    together = jax.jit(jax.vmap(jax.vmap(touches_wall, (None, 0))))(batch, cars)
    for i, name in enumerate(NAMES):
        np.testing.assert_array_equal(together[i], at_walls(padded(name), cars_at(poses[i])))
    mine = cars_at(poses[0])
    looped = jax.lax.scan(lambda _, car: (0, touches_wall(padded(NAMES[0]), car)), 0, mine)
    np.testing.assert_array_equal(together[0], looped[1])


def test_float64_is_exact_to_a_nanometre():
    with jax.enable_x64(True):
        track = load_track("gm", dtype=np.float64)
        start, end = long_wall(track)
        direction = (end - start) / np.hypot(*(end - start))
        normal = np.array([-direction[1], direction[0]])
        yaw = np.arctan2(direction[1], direction[0])
        for gap, expected in [(1e-9, False), (-1e-9, True)]:
            place = (start + end) / 2 + (BODY.width / 2 + gap) * normal
            car = at_rest(*(jnp.float64(value) for value in (*place, yaw)))
            assert bool(touches_wall(track, car)) is expected


@pytest.mark.parametrize("size", [(0.0, 0.3), (0.58, -0.1), (1.2, 0.4), (float("nan"), 0.3)])
def test_a_body_that_the_tracks_do_not_suit_is_refused(size):
    with pytest.raises(UsageError, match="does not suit the tracks"):
        Body(*size)


@pytest.mark.parametrize("field", range(3))
def test_a_pose_that_is_nan_is_not_taken_for_one_without_contact(field):
    poses = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], np.float32)
    poses[0, field] = np.nan
    assert at_walls(padded("gm"), cars_at(poses)).tolist() == [True, False]
    others = cars_at(np.array([[3.0, 0.0, 0.0]] * 2, np.float32))
    assert cars_touch(cars_at(poses), others).tolist() == [True, False]
    assert cars_touch(others, cars_at(poses)).tolist() == [True, False]
