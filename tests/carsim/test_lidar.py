"""Lidar readings against brute force and against what is known without any."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hprs.carsim import track as tracks
from hprs.carsim.construction import construct_track
from hprs.carsim.designs import load_track
from hprs.carsim.geometry import inside
from hprs.carsim.lidar import LIDAR, Lidar, beam_angles, measure, with_noise
from hprs.carsim.vehicle import Car, at_rest
from hprs.errors import UsageError
from tests.carsim import plain
from tests.carsim.tracks import NAMES, padded, track_of, walls_of

ANGLES = np.deg2rad(np.linspace(135, -135, 64))
scans = jax.jit(jax.vmap(measure, (None, 0)))
scans_behind = jax.jit(jax.vmap(measure, (None, 0, 0)))
one_scan = jax.jit(measure)
corridor_scans = jax.jit(jax.vmap(partial(measure, lidar=Lidar(beams=720)), (None, 0)))


def cars_at(poses) -> Car:
    return at_rest(*jnp.asarray(np.asarray(poses).T))


def car_at(*pose: float) -> Car:
    return at_rest(*jnp.asarray(pose, jnp.float32))


def free_poses(name: str, number: int, seed: int = 0, room: float = 0.1) -> np.ndarray:
    """Cars anywhere on the track, in any direction, their lidars in the free space."""
    track = padded(name)
    generator = np.random.default_rng(seed)
    index = generator.integers(tracks.POINTS, size=number)
    left, right = np.asarray(track.left)[index] - room, np.asarray(track.right)[index] - room
    offset = generator.uniform(-right, left)
    s = index / tracks.POINTS * float(track.length)
    x, y, _ = np.asarray(jax.vmap(partial(tracks.pose_at, track))(s, offset)).T
    return np.stack([x, y, generator.uniform(-4, 4, number)], axis=1).astype(np.float32)


def wrong(walls, poses, angles, found) -> np.ndarray:
    """Rows (pose, beam) of readings that are off by 1 cm.

    A beam along a wall or past a corner has the readings of the beams beside it too: those that
    turn by 4 microradians or start 10 micrometres aside, where float32 puts the beam as well.
    """
    off = np.abs(plain.readings(walls, poses, angles) - found) > 0.01
    suspects = np.unique(np.argwhere(off)[:, 0])
    beside = [
        plain.readings(walls, poses[suspects], angles + turn, aside=aside)
        for turn in (-4e-6, 0, 4e-6)
        for aside in (-1e-5, 0, 1e-5)
    ]
    if len(suspects):
        inside = np.min(beside, axis=0) - 0.01 <= found[suspects]
        inside &= found[suspects] <= np.max(beside, axis=0) + 0.01
        off[suspects] &= ~inside
    return np.argwhere(off)


@pytest.mark.parametrize("name", NAMES)
def test_a_million_random_beams_are_exact_to_a_centimetre(name):
    poses = free_poses(name, 2700)
    found = np.asarray(scans(padded(name), cars_at(poses)))
    assert not len(wrong(walls_of(name), poses, ANGLES, found))
    difference = np.abs(plain.readings(walls_of(name), poses, ANGLES) - found)
    # What needs the beams beside it is rare, so the rule above hides nothing.
    assert (difference > 0.001).mean() < 1e-5


def test_beams_that_graze_walls_are_exact():
    # Each middle beam aims at a point of a wall, at a milliradian to a tenth of a radian.
    name, number, generator = "trt", 4000, np.random.default_rng(2)
    walls = walls_of(name)[generator.integers(len(walls_of(name)), size=number)]
    yaw = np.arctan2(walls[:, 3] - walls[:, 1], walls[:, 2] - walls[:, 0])
    yaw -= 10 ** generator.uniform(-3, -1, number)
    target = walls[:, :2] + generator.uniform(0.01, 0.99, (number, 1)) * (
        walls[:, 2:] - walls[:, :2]
    )
    distance = generator.uniform(0.5, 12, (number, 1))
    sensor = target - distance * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    centre = sensor - plain.AHEAD * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    free = inside(sensor, walls_of(name))
    poses = np.column_stack([centre, yaw])[free].astype(np.float32)
    lidar = Lidar(beams=3)
    found = jax.vmap(partial(measure, lidar=lidar), (None, 0))(padded(name), cars_at(poses))
    assert len(poses) > 500
    assert not len(wrong(walls_of(name), poses, beam_angles(lidar), np.asarray(found)))


@pytest.mark.parametrize("beams", [1, 2, 64, 1080])
def test_any_number_of_beams_works(beams):
    lidar, poses = Lidar(beams=beams), free_poses("gm", 8)
    found = jax.vmap(partial(measure, lidar=lidar), (None, 0))(padded("gm"), cars_at(poses))
    assert found.shape == (8, beams)
    assert not len(wrong(walls_of("gm"), poses, beam_angles(lidar), np.asarray(found)))


def test_a_shorter_reach_cuts_readings():
    poses = cars_at(free_poses("trt", 50))
    short = jax.vmap(partial(measure, lidar=Lidar(reach=3.0)), (None, 0))(padded("trt"), poses)
    np.testing.assert_allclose(short, np.minimum(scans(padded("trt"), poses), 3.0), rtol=1e-4)
    assert (np.asarray(short) == 3).any()


# A corridor between a rectangle of 20 m x 8 m and one of 14 m x 2 m in its middle.
OUTER = np.array([[-10.0, -4.0], [10.0, -4.0], [10.0, 4.0], [-10.0, 4.0]])
INNER = np.array([[-7.0, -1.0], [7.0, -1.0], [7.0, 1.0], [-7.0, 1.0]])
MIDDLE = np.array([[-8.5, -2.5], [8.5, -2.5], [8.5, 2.5], [-8.5, 2.5]])


@cache
def rectangles(dtype=np.float32):
    return construct_track(MIDDLE, [OUTER, INNER], name="rectangles", dtype=dtype)


def reading(track, pose, angle, **others) -> float:
    """Along one angle in the world, of a lidar at a pose."""
    x, y, yaw = pose
    centre = (x - plain.AHEAD * np.cos(yaw), y - plain.AHEAD * np.sin(yaw), yaw)
    lidar = Lidar(beams=3, field_of_view=2 * abs(angle - yaw) or 1.0)
    found = measure(track, car_at(*centre), lidar=lidar, **others)
    return float(found[1 if angle == yaw else 0 if angle > yaw else 2])


@pytest.mark.parametrize(
    ("place", "yaw", "angle", "distance"),
    [
        ((0.0, -2.5), 0.0, 0.0, 10.0),
        ((0.0, -2.5), 0.0, np.pi / 2, 1.5),
        ((0.0, -2.5), 0.0, -np.pi / 2, 1.5),
        ((0.0, -2.5), 0.0, -np.pi / 6, 3.0),
        ((-9.0, -2.5), np.pi / 2, np.pi / 2, 6.5),
        ((-9.0, -2.5), np.pi / 2, 0.0, 15.0),
        ((-8.0, -2.5), 0.0, np.arctan2(1.5, 1.0), np.hypot(1.0, 1.5)),
        ((8.0, 2.5), 0.0, np.pi / 4, 1.5 * np.sqrt(2)),
    ],
)
def test_readings_between_rectangles_are_known(place, yaw, angle, distance):
    assert reading(rectangles(), (*place, yaw), angle) == pytest.approx(distance, abs=1e-4)


@pytest.mark.parametrize("height", [1e-6, 1e-4, 0.01])
@pytest.mark.parametrize("tilt", [1e-3, 1e-2, 0.1])
def test_close_to_a_wall_a_grazing_beam_is_as_long_as_its_slope_says(height, tilt):
    # Near the wall y = -4; float32 leaves the height uncertain by 1e-6 m.
    distance = reading(rectangles(), (-5.0, -4 + height, 0.0), -tilt)
    assert distance == pytest.approx(height / np.sin(tilt), abs=3e-6 / tilt)


def test_a_beam_parallel_to_a_wall_passes_it():
    assert reading(rectangles(), (-5.0, -3.9, 0.0), 0.0) == pytest.approx(15.0, abs=1e-4)
    assert reading(rectangles(), (-2.0, -3.9, 0.0), 0.0) == pytest.approx(12.0, abs=1e-4)


@pytest.mark.parametrize("aside", [-1e-7, 0.0, 1e-7])
def test_a_beam_along_the_line_of_a_wall_stops_at_the_walls_beginning(aside):
    # From the right of it, along the side y = -1 of the inner rectangle, which begins at x = 7.
    found = reading(rectangles(), (9.0, -1.0 + aside, np.pi), np.pi)
    assert min(abs(found - 2.0), abs(found - 15.0)) < 1e-4


def test_on_a_wall_beams_into_it_read_zero_and_others_what_they_see():
    on_wall = (0.0, -4.0, 0.0)
    assert reading(rectangles(), on_wall, -np.pi / 4) == pytest.approx(0.0, abs=1e-6)
    assert reading(rectangles(), on_wall, np.pi / 2) == pytest.approx(3.0, abs=1e-4)


def test_beams_into_a_corner_do_not_pass_between_its_walls():
    # Beams at and right beside the corner (10, -4), from many places.
    generator = np.random.default_rng(5)
    place = np.stack([generator.uniform(7.5, 9.5, 2000), generator.uniform(-3.5, 3.5, 2000)], 1)
    to_corner = [10.0, -4.0] - place
    angle = np.arctan2(to_corner[:, 1], to_corner[:, 0]) + generator.normal(0, 1e-7, 2000)
    centre = place - plain.AHEAD * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    poses = np.column_stack([centre, angle]).astype(np.float32)
    scan = jax.vmap(partial(measure, lidar=Lidar(beams=3)), (None, 0))
    found = scan(rectangles(), cars_at(poses))[:, 1]
    np.testing.assert_allclose(found, np.hypot(*to_corner.T), atol=1e-4)


@pytest.mark.parametrize("sides", [12, 64])
def test_in_a_round_corridor_readings_are_those_of_circles(sides):
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around)], axis=1)
    track = construct_track(3 * circle, [4 * circle, 2 * circle], name="ring")
    generator = np.random.default_rng(1)
    radius, at = generator.uniform(2.3, 3.7, 200), generator.uniform(0, 2 * np.pi, 200)
    yaw = generator.uniform(-3, 3, 200)
    poses = np.column_stack([radius * np.cos(at), radius * np.sin(at), yaw]).astype(np.float32)
    found = np.asarray(corridor_scans(track, cars_at(poses)))
    angles = beam_angles(Lidar(beams=720))
    # The polygons lie between their circles and the circles inside of them.
    flat = np.cos(np.pi / sides)
    longest = circle_readings(poses, angles, outer=4.0, inner=2.0 * flat)
    shortest = circle_readings(poses, angles, outer=4.0 * flat, inner=2.0)
    assert (found <= longest + 1e-3).all()
    assert (found >= shortest - 1e-3).all()


def circle_readings(poses, angles, *, outer, inner):
    """Between two circles around the origin."""
    poses = poses.astype(float)
    x = poses[:, :1] + plain.AHEAD * np.cos(poses[:, 2:])
    y = poses[:, 1:2] + plain.AHEAD * np.sin(poses[:, 2:])
    heading = poses[:, 2:] + angles
    ahead = -(x * np.cos(heading) + y * np.sin(heading))
    aside = x**2 + y**2 - ahead**2
    far = ahead + np.sqrt(outer**2 - aside)
    near = ahead - np.sqrt(np.maximum(inner**2 - aside, 0))
    return np.where((aside < inner**2) & (ahead > 0), near, far)


def test_a_wedge_is_exact_to_its_tip():
    # Walls that close at 0.02 rad, 10 m long; beams along the middle and close to the walls.
    slope, end = 0.02, 10.0
    tip = np.array([[0.0, -1.0], [end, -1.0 + slope * end], [0.0, 1.0]])
    hall = np.array([[0.0, 3.0], [-9.0, 3.0], [-9.0, -3.0], [0.0, -3.0]])
    outline = np.concatenate([[tip[0]], [[end, 0.0]], [tip[2]], hall])
    post = np.array([[-5.0, -0.5], [-4.0, -0.5], [-4.0, 0.5], [-5.0, 0.5]])
    around = np.array([[-7.0, -1.75], [-2.0, -1.75], [-2.0, 1.75], [-7.0, 1.75]])
    track = construct_track(around, [outline, post], name="wedge")
    walls = np.asarray(track.walls, float)
    generator = np.random.default_rng(4)
    number = 2000
    x = generator.uniform(-3, 8, number)
    room = np.where(x < 0, 0.9, (1 - x / end) * 0.9)
    poses = np.column_stack(
        [x, generator.uniform(-room, room), generator.normal(0, 0.05, number)]
    ).astype(np.float32)
    lidar = Lidar(beams=101, field_of_view=0.4)
    found = jax.vmap(partial(measure, lidar=lidar), (None, 0))(track, cars_at(poses))
    assert not len(wrong(walls, poses, beam_angles(lidar), np.asarray(found)))


@pytest.mark.parametrize("distance", [0.6, 1.0, 2.5, 7.0])
def test_a_car_in_front_is_seen_at_its_tail(distance):
    other = car_at(-6.0 + distance, -2.5, 0.0)
    found = reading(rectangles(), (-6.0, -2.5, 0.0), 0.0, others=other)
    assert found == pytest.approx(distance - 0.29, abs=1e-4)


def test_cars_are_seen_as_rectangles_and_behind_walls_they_are_not():
    poses = free_poses("gm-c", 1500, seed=6)
    others = free_poses("gm-c", 1500, seed=7)
    clear = np.hypot(*(poses - others)[:, :2].T) > 0.7
    poses, others = poses[clear], others[clear]
    found = np.asarray(scans_behind(padded("gm-c"), cars_at(poses), cars_at(others)))
    empty = np.asarray(scans(padded("gm-c"), cars_at(poses)))
    for pose, other, scan in zip(poses[:150], others, found, strict=False):
        walls = np.concatenate([walls_of("gm-c"), plain.sides(other)])
        assert not len(wrong(walls, pose[None], ANGLES, scan[None]))
    assert (found <= empty).all()
    assert 0.01 < (found < empty - 0.01).mean() < 0.5


def test_several_cars_hide_what_each_of_them_hides():
    track, me = rectangles(), car_at(-6.0, -2.5, 0.0)
    poses = [(-4.0, -2.2, 0.3), (-5.0, -3.3, -1.0), (0.0, -2.5, 0.0)]
    together = one_scan(track, me, cars_at(np.array(poses, np.float32)))
    each = [one_scan(track, me, car_at(*pose)) for pose in poses]
    np.testing.assert_allclose(together, np.min(each, axis=0), rtol=1e-6)


names = st.sampled_from(NAMES)


@settings(max_examples=60, deadline=None)
@given(names, st.integers(0, 2**31))
def test_a_scan_is_in_range_and_turns_with_the_car(name, seed):
    track, pose = padded(name), free_poses(name, 1, seed)[0]
    scan = np.asarray(one_scan(track, car_at(*pose)))
    assert ((scan > 0) & (scan <= 15)).all()
    # About the lidar by two beams: readings move by two places.
    turn = ANGLES[0] - ANGLES[2]
    sensor = pose[:2] + plain.AHEAD * np.array([np.cos(pose[2]), np.sin(pose[2])])
    yaw = float(pose[2]) - turn
    centre = sensor - plain.AHEAD * np.array([np.cos(yaw), np.sin(yaw)])
    turned = np.asarray(one_scan(track, car_at(*centre, yaw)))
    # At a corner the last place of an angle decides.
    assert (np.abs(turned[:-2] - scan[2:]) < 0.01).sum() >= 60


@pytest.mark.parametrize("place", [(1e3, 0.0), (-1e3, 1e3), (1e5, 1e5), (0.0, 0.0)])
def test_outside_of_the_free_space_readings_stay_in_range(place):
    scan = np.asarray(one_scan(rectangles(), car_at(*place, 0.3)))
    assert ((scan >= 0) & (scan <= 15)).all()


def test_filling_walls_are_never_seen():
    poses = cars_at(free_poses("gm", 300))
    more = replace(
        padded("gm"),
        visible=jnp.pad(padded("gm").visible, ((0, 0), (0, 0), (0, 7)), constant_values=tracks.FAR),
    )
    np.testing.assert_array_equal(scans(more, poses), scans(padded("gm"), poses))


def test_a_batch_of_tracks_a_loop_and_single_calls_agree():
    batch = tracks.stack_tracks([track_of(name) for name in NAMES])
    poses = np.stack([free_poses(name, 5) for name in NAMES])
    cars = at_rest(*jnp.moveaxis(jnp.asarray(poses), -1, 0))
    together = jax.jit(jax.vmap(jax.vmap(measure, (None, 0))))(batch, cars)
    for i, name in enumerate(NAMES):
        alone = scans(padded(name), cars_at(poses[i]))
        np.testing.assert_allclose(together[i], alone, rtol=1e-4)
    track, mine = padded(NAMES[0]), cars_at(poses[0])
    looped = jax.lax.scan(lambda _, car: (0, measure(track, car)), 0, mine)[1]
    np.testing.assert_allclose(together[0], looped, rtol=1e-4)
    unpadded = measure(track_of(NAMES[0]), car_at(*poses[0][0]))
    np.testing.assert_allclose(together[0][0], unpadded, rtol=1e-4)


def test_in_float64_readings_are_exact_to_a_nanometre():
    poses = free_poses("gm", 500).astype(float)
    with jax.enable_x64(True):
        track = load_track("gm", dtype=np.float64)
        found = scans(track, cars_at(poses))
        assert found.dtype == jnp.float64
        expected = plain.readings(np.asarray(track.walls), poses, ANGLES)
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_in_float32_everything_is_float32():
    assert one_scan(padded("gm"), car_at(0.0, 0.0, 0.0)).dtype == jnp.float32


def test_noise_is_a_share_of_the_distance_and_stays_in_reach():
    scan = jnp.array([0.5, 10.0, 15.0, 15.0])
    noisy = with_noise(scan, jnp.array([1.0, -1.0, 1.0, -0.5]), share=0.03)
    np.testing.assert_allclose(noisy, [0.515, 9.7, 15.0, 14.775], rtol=1e-6)


def test_the_first_beam_points_to_the_left_rear_and_beams_are_equally_spaced():
    angles = beam_angles()
    assert len(angles) == LIDAR.beams == 64
    np.testing.assert_allclose(np.rad2deg(angles[[0, -1]]), [135, -135])
    np.testing.assert_allclose(np.diff(angles), -np.deg2rad(270) / 63)


@pytest.mark.parametrize(
    "wrong_value", [{"beams": 0}, {"reach": 0.0}, {"reach": 20.0}, {"field_of_view": 7.0}]
)
def test_a_lidar_that_cannot_be_is_refused(wrong_value):
    with pytest.raises(UsageError, match=r"A lidar"):
        Lidar(**wrong_value)


@pytest.mark.parametrize("field", range(3))
def test_a_pose_that_is_nan_gives_readings_that_are_nan(field):
    pose, other = free_poses("gm-c", 2, seed=6)[:, None].repeat(2, axis=1)
    pose[0, field] = other[1, field] = np.nan
    assert np.isnan(scans(padded("gm-c"), cars_at(pose))[0]).all()
    # One world in a batch says nothing about the others.
    assert np.isfinite(scans(padded("gm-c"), cars_at(pose))[1]).all()
    assert np.isnan(scans_behind(padded("gm-c"), cars_at(pose), cars_at(other))).all()
