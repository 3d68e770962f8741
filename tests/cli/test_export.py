"""`hprs export` writes files that run elsewhere, and that say where they come from."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

from hprs.deploy import load_bundle, save_bundle
from hprs.deploy.record import Record
from hprs.deploy.runtime import NAME
from tests.deploy.simulated_car import BUNDLE, FakeClock, SimulatedCar, trained_bundle
from tests.deploy.small import checked

CART_POLE = "hprs/CartPole-v0"
SAFE_DRIVING = "hprs/SafeDriving-v0"
SMALL = ("--set", "n_steps=8", "--set", "environments=4", "--set", "batch_size=16")


@pytest.fixture
def run_folder(hprs, here):
    code, _, err = hprs("train", CART_POLE, "--trainer", "jax", "--steps", 64, *SMALL)
    assert code == 0, err
    return next(here.glob("runs/*/*/seed-0"))


def test_a_run_becomes_a_bundle_a_runtime_and_an_onnx_file(hprs, here, run_folder):
    code, out, err = hprs("export", run_folder, "policy.bundle")
    assert code == 0, err
    assert out.splitlines() == [
        "Written: policy.bundle, which has checked itself",
        f"Written: {NAME}",
        "Written: policy.onnx, of opset 17",
    ]
    found = load_bundle(here / "policy.bundle")
    assert found.provenance["environment"] == CART_POLE
    assert found.provenance["versions"].keys() >= {"python", "numpy", "jax"}
    assert "commit" in found.provenance
    assert found.provenance["which"] == "last"
    assert found.observation.details["signals"][0] == {"name": "x", "place": "[0]", "unit": "m"}
    assert found.rate == 50
    done = subprocess.run(
        [sys.executable, NAME, "policy.bundle"], capture_output=True, text=True, check=True
    )
    assert "self-check     passed" in done.stdout
    answers = []
    for policy in ("policy.bundle", "policy.onnx"):
        code, out, err = hprs("evaluate", CART_POLE, "--policy", policy, "--episodes", 2, "--json")
        assert code == 0, err
        answers.append(out.replace(policy, ""))
    assert answers[0] == answers[1]


def test_without_onnx_the_rest_is_written_and_the_hint_given(hprs, here, monkeypatch):
    monkeypatch.delitem(sys.modules, "hprs.deploy.onnx", raising=False)
    monkeypatch.setitem(sys.modules, "onnx", None)
    code, out, _ = hprs("export", BUNDLE, "policy.bundle", "--environment", SAFE_DRIVING)
    assert code == 0
    assert out.splitlines()[-1] == (
        "Not written: policy.onnx. onnx is not installed. Install it with: pip install 'hprs[onnx]'"
    )
    assert (here / NAME).exists()


def test_an_older_bundle_is_completed(hprs, here):
    old = load_bundle(BUNDLE)
    assert hprs("export", BUNDLE, "policy.bundle", "--environment", SAFE_DRIVING)[0] == 0
    found = load_bundle(here / "policy.bundle")
    lidar = found.observation.details["lidar"]
    assert (lidar["reach"], lidar["ahead_of_rear_axle"]) == (15.0, pytest.approx(0.217))
    assert found.action.details["steering_angle"] == pytest.approx(0.21)
    np.testing.assert_array_equal(found.check_actions, old.check_actions)
    assert found.task == old.task


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        ((BUNDLE, "policy.bundle"), 2, "does not say where it was trained"),
        ((BUNDLE, "policy.zip", "--environment", SAFE_DRIVING), 2, "the name of a bundle ends in .bundle"),
        ((BUNDLE, "none/policy.bundle", "--environment", SAFE_DRIVING), 2, "there is no folder 'none'"),
        ((BUNDLE, "policy.bundle", "--environment", "hprs/SafeDrivin-v0"), 2, "Did you mean"),
        ((BUNDLE, "policy.bundle", "--environment", "hprs/FollowLeader-v0"), 1, "sees observations of shape (71,); this environment has shape (201,)"),
        (("gone", "policy.bundle"), 2, "there is no run 'gone'"),
        (("text.bundle", "policy.bundle"), 1, "it is damaged, or no bundle"),
    ],
)  # fmt: skip
def test_what_cannot_be_exported_is_named(hprs, here, arguments, code, message):
    (here / "text.bundle").write_text("no bundle")
    found, _, err = hprs("export", *arguments)
    assert (found, err.count("\n")) == (code, 1), err
    assert message in err
    assert not (here / NAME).exists()


def test_a_bundle_that_fails_its_self_check_is_not_exported(hprs, here):
    from dataclasses import replace

    bundle = load_bundle(BUNDLE)
    save_bundle(replace(bundle, check_actions=bundle.check_actions + 0.1), here / "bad.bundle")
    code, _, err = hprs("export", "bad.bundle", "policy.bundle", "--environment", SAFE_DRIVING)
    assert code == 1
    assert "self-check failed" in err
    assert not (here / "policy.bundle").exists()


def test_a_bundle_trained_elsewhere_is_not_renamed(hprs, here):
    from dataclasses import replace

    save_bundle(replace(checked(), provenance={"environment": CART_POLE}), here / "a.bundle")
    code, _, err = hprs("export", "a.bundle", "b.bundle", "--environment", SAFE_DRIVING)
    assert code == 2
    assert "was trained in hprs/CartPole-v0, not in hprs/SafeDriving-v0" in err


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A driven lap with the simulator's truth."""
    from hprs.deploy.loop import ControlLoop

    file = tmp_path_factory.mktemp("log") / "drive.csv"
    clock, car = FakeClock(), SimulatedCar("gm")
    plain = ControlLoop(trained_bundle(), clock=clock)
    record = Record(file, plain.monitor.signals, plain.monitor.labels)
    loop = ControlLoop(trained_bundle(), dead_man=False, clock=clock, record=record)
    while car.progress < 1:
        loop.hear_scan(car.scan())
        loop.hear_speed(car.speed)
        loop.hear_signals(car.truth())
        found = loop.tick()
        if car.progress < 1:
            car.obey(found)
        clock.sleep(0.1)
    loop.hear_scan(car.scan())
    loop.hear_speed(car.speed)
    loop.hear_signals(car.truth())
    loop.tick()
    loop.close()
    return file


def test_a_drive_is_assessed(hprs, here, log):
    code, out, err = hprs("assess", log, "--task", SAFE_DRIVING, "--json")
    assert code == 0, err
    found = json.loads(out)
    assert found["safe"]
    assert found["target"]
    assert 1.5 <= found["pam"] <= 1.75
    # At a standstill the noise of the odometry is below 0 as often as above.
    assert found["outside_ranges"].keys() <= {"speed"}


def test_a_drive_is_filmed(hprs, here, log):
    shutil.copy(log, here / "drive.csv")
    code, _, err = hprs("watch", "drive.csv", "--task", SAFE_DRIVING, "--out", "drive.gif")
    assert code == 0, err
    assert (here / "drive.gif").stat().st_size > 1000
