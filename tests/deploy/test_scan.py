"""Any lidar's scan becomes the beams of the training."""

import math

import numpy as np
import pytest

from hprs.carsim.lidar import LIDAR, Lidar, beam_angles, measure
from hprs.deploy.driving import Driving
from hprs.deploy.scan import Beams, Mounting, Scan, refusal, resample
from hprs.errors import BundleError
from tests.deploy.simulated_car import SimulatedCar, trained_bundle

BEAMS = Beams(count=5, first=math.pi / 2, last=-math.pi / 2, reach=15.0, ahead=0.2)
HERE = Mounting(0.2)
NAN, INFINITE = math.nan, math.inf


def room(angles, half=2.0, ahead=0.0, left=0.0):
    """Distances to the walls of a square room from a place in it, at angles from straight ahead."""
    x, y = np.cos(angles), np.sin(angles)
    along = (half - ahead * np.sign(x)) / np.maximum(np.abs(x), 1e-9)
    across = (half - left * np.sign(y)) / np.maximum(np.abs(y), 1e-9)
    return np.minimum(along, across)


def scan_of(count=1081, view=270.0, **place):
    angles = np.radians(np.linspace(-view / 2, view / 2, count))
    return Scan(room(angles, **place), float(angles[0]), float(angles[1] - angles[0]), 0.05, 30.0)


def test_in_a_square_room_beams_read_the_distances_worked_by_hand():
    wanted = [2.0, 2 * math.sqrt(2), 2.0, 2 * math.sqrt(2), 2.0]
    np.testing.assert_allclose(resample(scan_of(), BEAMS, HERE), wanted, rtol=1e-4)


@pytest.mark.parametrize("count", [271, 541, 682, 1080, 1081, 4000])
def test_the_number_of_readings_does_not_matter(count):
    # 1.5 degrees and less; one reading beside a corner is off by its angle's sine.
    found = resample(scan_of(count), BEAMS, HERE)
    np.testing.assert_allclose(found, room(BEAMS.angles), rtol=0.01)


def test_readings_may_run_either_way_and_all_around():
    plain = scan_of()
    last = plain.angle_min + (len(plain.ranges) - 1) * plain.angle_increment
    turned = Scan(plain.ranges[::-1], last, -plain.angle_increment, 0.05, 30.0)
    np.testing.assert_allclose(
        resample(turned, BEAMS, HERE), resample(plain, BEAMS, HERE), atol=1e-12
    )
    angles = np.arange(0, 2 * math.pi, math.radians(0.5))
    around = Scan(room(angles), 0.0, math.radians(0.5), 0.05, 30.0)
    assert refusal(around, BEAMS, HERE) == ""
    np.testing.assert_allclose(resample(around, BEAMS, HERE), room(BEAMS.angles), rtol=1e-3)


def test_a_lidar_that_is_turned_or_upside_down_is_undone():
    yaw = math.radians(20)
    angles = np.radians(np.linspace(-135, 135, 1081))
    turned = Scan(room(angles + yaw, left=0.5), angles[0], angles[1] - angles[0], 0.05, 30.0)
    wanted = room(BEAMS.angles, left=0.5)
    np.testing.assert_allclose(resample(turned, BEAMS, Mounting(0.2, yaw=yaw)), wanted, rtol=1e-3)
    flipped = Scan(room(-angles, left=0.5), angles[0], angles[1] - angles[0], 0.05, 30.0)
    found = resample(flipped, BEAMS, Mounting(0.2, upside_down=True))
    np.testing.assert_allclose(found, wanted, rtol=1e-3)


def test_a_lidar_that_sits_elsewhere_sees_from_the_place_of_the_training():
    elsewhere = scan_of(ahead=0.3, left=-0.1)
    found = resample(elsewhere, BEAMS, Mounting(0.5, left=-0.1))
    np.testing.assert_allclose(found, room(BEAMS.angles), rtol=0.01)


def test_what_is_no_reading_is_not_taken_for_one():
    plain = scan_of()
    middle = len(plain.ranges) // 2
    for value, wanted in (
        (NAN, 2.0),  # its neighbours'
        (0.0, 2.0),  # below range_min
        (INFINITE, 15.0),  # nothing within reach
        (65.5, 15.0),  # above range_max
        (-INFINITE, 0.05),  # nearer than can be measured
    ):
        ranges = plain.ranges.copy()
        ranges[middle] = value
        found = resample(plain._replace(ranges=ranges), BEAMS, HERE)
        assert found[2] == pytest.approx(wanted, rel=1e-3), value


def test_where_no_reading_is_near_a_beam_is_unknown():
    plain = scan_of()
    ranges = plain.ranges.copy()
    angles = np.degrees(plain.angle_min + np.arange(len(ranges)) * plain.angle_increment)
    ranges[np.abs(angles) < 30] = NAN
    found = resample(plain._replace(ranges=ranges), BEAMS, HERE)
    assert np.isnan(found).tolist() == [False, False, True, False, False]
    blind = resample(plain._replace(ranges=np.full(1081, NAN)), BEAMS, HERE)
    assert np.isnan(blind).all()


def test_without_an_echo_a_shorter_lidar_reads_its_own_reach():
    plain = scan_of()
    ranges = np.full(len(plain.ranges), INFINITE)
    short = plain._replace(ranges=ranges, range_max=10.0)
    assert resample(short, BEAMS, HERE).tolist() == [10.0] * 5


def test_a_thing_before_a_wall_is_not_blended_with_it():
    plain = scan_of(half=8.0)
    ranges = plain.ranges.copy()
    middle = len(ranges) // 2
    ranges[: middle + 1] = 1.0
    # Half a reading beyond the edge: one or the other, and nothing between them.
    beams = Beams(1, math.radians(0.125), math.radians(0.125), 15.0, 0.2)
    (found,) = resample(plain._replace(ranges=ranges), beams, HERE)
    assert min(abs(found - 1.0), abs(found - 8.0)) < 0.01


@pytest.mark.parametrize(
    ("scan", "message"),
    [
        (scan_of(view=240.0), ""),
        (scan_of(view=170.0), "sees from -85.0 to 85.0 degrees, the policy from -90.0 to 90.0"),
        (scan_of()._replace(ranges=[1.0]), "a scan of 1 readings from -2.3"),
        (scan_of()._replace(angle_increment=0.0), "all have one angle"),
        (scan_of()._replace(angle_min=NAN), "is no scan"),
    ],
)
def test_a_lidar_that_cannot_serve_is_named(scan, message):
    found = refusal(scan, BEAMS, HERE)
    assert message in found
    assert bool(found) == bool(message)


def test_a_mounting_is_finite():
    with pytest.raises(BundleError, match="mounting: yaw is nan"):
        Mounting(0.2, yaw=NAN)


def test_in_the_simulator_beams_are_those_of_the_training():
    driving = Driving.of(trained_bundle())
    car = SimulatedCar("gm")
    np.testing.assert_allclose(driving.beams.angles, beam_angles(LIDAR), atol=1e-12)
    wrong = []
    for seed in range(20):
        car = car if seed == 0 else SimulatedCar("gm", seed)
        exact = np.asarray(measure(car.track, car.car, lidar=Lidar()))
        found = resample(car.scan(), driving.beams, Mounting(driving.beams.ahead))
        wrong.append(np.abs(found / exact - 1))
    wrong = np.concatenate(wrong)
    # Only beams that pass a corner closely differ: by an eighth of a degree they see past it.
    print(np.quantile(wrong, [0.5, 0.9, 0.99, 1]), (wrong > 0.01).mean())
    assert np.median(wrong) < 1e-4
    assert np.quantile(wrong, 0.97) < 0.01
