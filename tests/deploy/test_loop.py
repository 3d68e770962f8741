"""The loop drives as in training, waits for its driver, and stops when it knows no more."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hprs.deploy import Layer, ObservationLayout, save_bundle
from hprs.deploy.archive import load_bundle
from hprs.deploy.driving import Driving
from hprs.deploy.loop import DRIVING, STOPPED, WAITING, ControlLoop, Limits, pace, run
from hprs.deploy.record import Record
from hprs.deploy.scan import Scan
from hprs.errors import BundleError
from tests.deploy.simulated_car import FakeClock, SimulatedCar, trained_bundle
from tests.deploy.small import numbers, small

INFINITE = math.inf


@pytest.fixture(scope="module")
def bundle():
    return trained_bundle()


@pytest.fixture
def clock():
    return FakeClock()


def corridor(distance=2.0, count=1080):
    increment = math.radians(270) / (count - 1)
    return Scan(np.full(count, distance), -math.radians(135), increment, 0.06, 30.0)


@pytest.fixture
def made(bundle, clock):
    def make(**options):
        return ControlLoop(bundle, clock=clock, **{"dead_man": False, **options})

    return make


def hear(loop, scan=None, speed=0.5):
    loop.hear_scan(scan or corridor())
    loop.hear_speed(speed)


def drive(loop, clock, ticks=3, **heard):
    """Some ticks with everything as it should be."""
    for _ in range(ticks):
        hear(loop, **heard)
        found = loop.tick()
        assert (found.phase, found.reason) == (DRIVING, "")
        clock.sleep(0.1)
    hear(loop, **heard)
    return found


def assert_latched(loop, clock, found, reason):
    assert (found.speed, found.phase) == (0.0, STOPPED)
    assert reason in found.reason
    # All is well again, and it stays stopped.
    hear(loop)
    later = loop.tick()
    assert (later.speed, later.phase, later.reason) == (0.0, STOPPED, found.reason)
    loop.release()
    hear(loop)
    clock.sleep(0.01)
    assert loop.tick().phase == DRIVING


def test_it_drives_a_lap_in_the_simulator_through_1080_beams_and_odometry(made, clock, tmp_path):
    car = SimulatedCar("gm")
    loop = made()
    rows = 0
    while car.progress < 1 and rows < 150:
        loop.hear_scan(car.scan())
        loop.hear_speed(car.speed)
        found = loop.tick()
        assert found.phase == DRIVING, found.reason
        car.obey(found)
        clock.sleep(0.1)
        rows += 1
    assert car.progress >= 1
    assert not bool(car.world.hit_wall[0])
    # By itself a car knows nothing of the lap and the walls.
    assert {one.label for one in loop.verdicts if one.satisfied is None} == {
        "no_collision", "lap", "centred",
    }  # fmt: skip


def test_its_observations_and_commands_are_those_of_the_simulation(bundle, made, clock):
    import jax
    import jax.numpy as jnp

    from hprs.envs.functional import make

    # As many readings as the policy's beams: nothing is interpolated.
    car = SimulatedCar("gm", beams=64)
    simulation = make("hprs/SafeDriving-v0", tracks="gm", randomisation="nominal")
    step = jax.jit(simulation.step)
    key = jax.random.key(3)
    episode, observation, signals = simulation.reset(key)
    loop = made()
    count = car.driving.beams.count
    for _ in range(25):
        ranges = np.asarray(episode.scans[-1], np.float64)[::-1]
        increment = math.radians(270) / (count - 1)
        loop.hear_scan(Scan(ranges, -math.radians(135), increment, 0.0, 30.0))
        loop.hear_speed(float(episode.speeds[-1]))
        loop.hear_signals({name: float(signals[name]) for name in ("progress", "collision")})
        found = loop.tick()
        assert found.phase == DRIVING, found.reason
        # The command that the tick has added is not in what it saw.
        seen = loop._memory.observation()
        np.testing.assert_allclose(seen[6:], observation[6:], atol=2e-6)
        np.testing.assert_allclose(seen[:4], observation[2:6], atol=1e-6)
        for name in ("steering", "speed_command", "last_steering", "last_speed_command"):
            assert loop._judged[name] == pytest.approx(float(signals[name]), abs=1e-6)
        action = bundle(np.asarray(observation))
        episode, observation, signals, *_ = step(episode, jnp.asarray(action))
        steering, speed = map(float, episode.commands[-1])
        assert found.steering_angle == pytest.approx(0.21 * steering, abs=1e-5)
        assert found.speed == pytest.approx((speed + 1) / 2 * 3.5 * 1.1, abs=1e-4)
        clock.sleep(0.1)


def test_it_waits_until_all_is_heard(made, clock):
    loop = made()
    assert loop.tick()[2:] == (WAITING, "no scan yet")
    loop.hear_scan(corridor())
    assert loop.tick()[2:] == (WAITING, "no odometry yet")
    loop.hear_speed(0.0)
    found = loop.tick()
    assert found.phase == DRIVING
    # The first action is taken from standing: at most 0.4 m/s, times the gain.
    assert 0 <= found.speed <= 0.4 * 1.1 + 1e-6


def test_the_dead_man_switch_must_be_held(made, clock):
    loop = made(dead_man=True)
    hear(loop)
    assert loop.tick()[2:] == (WAITING, "the dead-man switch is released")
    loop.hear_dead_man(True)
    assert loop.tick().phase == DRIVING
    loop.hear_dead_man(False)
    assert loop.check() == (0.0, pytest.approx(loop._angle), WAITING, "the dead-man switch is released")
    # Not latched; it starts again from standing.
    loop.hear_dead_man(True)
    hear(loop)
    assert loop.tick().speed <= 0.4 * 1.1 + 1e-6
    # A joystick that is silent holds nothing.
    for _ in range(6):
        clock.sleep(0.1)
        hear(loop)
        found = loop.tick()
    assert (found.speed, found.phase) == (0.0, WAITING)


@pytest.mark.parametrize("silent", ["scan", "odometry"])
def test_silence_is_seen_between_two_ticks(made, clock, silent):
    loop = made()
    drive(loop, clock)
    waited = 0.0
    while True:
        clock.sleep(0.02)
        waited += 0.02
        loop.hear_speed(0.5) if silent == "scan" else loop.hear_scan(corridor())
        found = loop.check()
        if found is not None:
            break
        if abs(waited - 0.1) < 1e-9:
            loop.tick()
    assert 0.2 < waited <= 0.23
    assert_latched(loop, clock, found, f"no {silent} for 2")


def test_a_late_tick_stops_it(made, clock):
    loop = made()
    drive(loop, clock)
    assert_latched(loop, clock, loop.tick(due=clock() - 0.15), "a tick was 150 ms late")
    drive(loop, clock, ticks=1)
    clock.sleep(0.25)
    hear(loop)
    assert_latched(loop, clock, loop.check(), "no tick for ")


def test_a_late_policy_stops_it(bundle, made, clock, monkeypatch):
    loop = made()
    drive(loop, clock)
    plain = loop._acted

    def slowly():
        clock.sleep(0.06)
        return plain()

    monkeypatch.setattr(loop, "_acted", slowly)
    found = loop.tick()
    monkeypatch.undo()
    assert_latched(loop, clock, found, "the policy took 60 ms")


def test_what_cannot_be_driven_by_stops_it(made, clock):
    half = corridor()
    half.ranges[:400] = math.nan
    narrow = corridor()._replace(angle_increment=math.radians(0.2))
    for heard, reason in (
        ({"scan": half}, "of 64 beams have no reading"),
        ({"scan": narrow}, "this lidar sees from -135.0 to 80.8 degrees, the policy"),
        ({"speed": math.nan}, "odometry says a speed of nan"),
    ):
        loop = made()
        drive(loop, clock)
        hear(loop, **heard)
        assert_latched(loop, clock, loop.tick(), reason)


def test_a_few_beams_without_reading_are_filled_from_their_neighbours(made, clock):
    scan = corridor()
    scan.ranges[500:560] = math.nan
    loop = made()
    drive(loop, clock, scan=scan)
    np.testing.assert_allclose(loop._memory._scans[-1], 2.0, rtol=1e-9)


def acting(bundle, *outputs, mapping="clip", bounds=(-1, 1)):
    """A bundle whose network always answers the same."""
    size = bundle.observation.size
    layer = Layer(np.zeros((size, 2), np.float32), numbers(*outputs))
    low, high = (np.full(2, bound, np.float32) for bound in bounds)
    action = replace(bundle.action, low=low, high=high, mapping=mapping)
    made = replace(bundle, layers=(layer,), action=action, check_observations=None, check_actions=None)
    seen = np.zeros((1, size), np.float32)
    shaped = made.batch(seen.reshape(1, *made.observation.shape))
    return replace(made, check_observations=seen, check_actions=shaped)


def test_an_action_out_of_range_stops_it(bundle, clock):
    wild = acting(bundle, 2.0, 0.0, mapping="raw", bounds=(-9, 9))
    loop = ControlLoop(wild, dead_man=False, clock=clock)
    hear(loop)
    found = loop.tick()
    assert (found.speed, found.phase) == (0.0, STOPPED)
    assert found.reason == "the policy's action (2, 0) is outside [-1, 1]"


def test_an_action_of_nan_stops_it(bundle, clock, monkeypatch):
    loop = ControlLoop(bundle, dead_man=False, clock=clock)
    monkeypatch.setattr(loop, "_bundle", lambda observation: np.array([math.nan, 0.0]))
    hear(loop)
    assert loop.tick()[2:] == (STOPPED, "the policy's action is (nan, 0.0)")


def test_a_violated_safety_requirement_stops_it(made, clock):
    loop = made()
    drive(loop, clock)
    loop.hear_signals({"collision": 1.0})
    found = loop.tick()
    assert found[2:] == (STOPPED, "no_collision is violated")
    loop.hear_signals({"collision": 0.0})
    assert_latched(loop, clock, found, "no_collision is violated")


def test_speed_is_integrated_up_to_the_largest_and_down_to_standing(bundle, clock):
    loop = ControlLoop(acting(bundle, 1.0, -0.5), dead_man=False, clock=clock)
    speeds = []
    for _ in range(12):
        hear(loop)
        speeds.append(loop.tick())
        clock.sleep(0.1)
    wanted = [min(0.4 * (n + 1), 3.5) * 1.1 for n in range(12)]
    np.testing.assert_allclose([one.speed for one in speeds], wanted, atol=1e-6)
    assert speeds[-1].steering_angle == pytest.approx(-0.105)
    braking = ControlLoop(acting(bundle, -1.0, 0.0), dead_man=False, clock=clock)
    assert drive(braking, clock).speed == 0.0


def test_a_speed_limit_is_part_of_what_the_policy_remembers(bundle, clock):
    limited = ControlLoop(
        acting(bundle, 1.0, 0.0), dead_man=False, clock=clock, limits=Limits(speed=1.0)
    )
    assert drive(limited, clock, ticks=8).speed == pytest.approx(1.0)
    assert limited._memory.commands[-1][1] == pytest.approx(2 / 3.85 - 1)


def test_it_runs_at_10_hz_and_measures_its_jitter(bundle, clock):
    loop = ControlLoop(bundle, dead_man=False, clock=clock)
    told, times = [], []

    def publish(drive):
        hear(loop)
        told.append(drive)
        times.append(clock())
        # A publication takes a while, and every tenth one longer.
        clock.sleep(0.03 if len(told) % 10 == 0 else 0.001)

    run(loop, publish, sleep=clock.sleep, going=lambda: len(told) < 50)
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-6)
    found = pace(loop)
    assert found.ticks == 50
    assert found.most == pytest.approx(0.0, abs=1e-6)
    told.clear()

    def slow(drive):
        publish(drive)
        clock.sleep(0.149)

    run(loop, slow, sleep=clock.sleep, going=lambda: len(told) < 3)
    assert pace(loop).ticks == 53


def test_a_drive_is_logged_and_stops_with_its_reason(bundle, clock, tmp_path):
    file = tmp_path / "drive.csv"
    loop_ = ControlLoop(bundle, dead_man=False, clock=clock)
    record = Record(file, loop_.monitor.signals, loop_.monitor.labels)
    loop = ControlLoop(bundle, dead_man=False, clock=clock, record=record)
    drive(loop, clock)
    loop.hear_signals({"collision": 1.0})
    loop.tick()
    text = file.read_text().splitlines()
    loop.close()
    assert text[0].startswith("time,progress,collision,clearance,speed,steering,")
    assert len(text) == 5
    assert text[-1].split(",")[2] == "1"
    assert '"stopped","no_collision is violated",0,' in text[-1]
    with pytest.raises(BundleError, match=r"drive\.csv cannot be written: File exists"):
        Record(file, {}, [])


def test_a_bundle_that_does_not_drive_is_refused_by_name(bundle, tmp_path):
    from tests.deploy.small import checked

    with pytest.raises(BundleError, match="does not say what its observations are on a car"):
        ControlLoop(checked())
    short = dict(bundle.observation.details)
    short["parts"] = [*short["parts"][:1], {**short["parts"][1], "components": 60}, short["parts"][2]]
    wrong = replace(bundle, observation=replace(bundle.observation, details=short))
    with pytest.raises(BundleError) as error:
        Driving.of(wrong)
    assert str(error.value) == (
        "its layout has 67 numbers (commands 3 x 2, scans 1 x 60, speeds 1 x 1), its observations "
        "shape (71,)."
    )
    for lacking in ("lidar", "parts"):
        held = {key: value for key, value in bundle.observation.details.items() if key != lacking}
        with pytest.raises(BundleError, match=f"its layout lacks a part: KeyError.'{lacking}'"):
            Driving.of(replace(bundle, observation=replace(bundle.observation, details=held)))
    changed = replace(bundle, check_actions=bundle.check_actions + 1)
    with pytest.raises(BundleError, match="self-check failed"):
        ControlLoop(changed)
