"""Over a real ROS 1 the car drives a lap, and stands when its lidar falls silent."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hprs.cli import main
from hprs.deploy import save_bundle
from hprs.deploy.runtime import NAME, runtime_source
from tests.deploy.simulated_car import trained_bundle

CAR = Path(__file__).with_name("ros1_car.py")
SYSTEM = "/usr/bin/python3"
"""It has the packages of ROS, and no hprs: what drives is the runtime."""


@pytest.fixture
def roscore():
    """The program; without it a test is skipped, or fails where it must not be missing."""
    found = shutil.which("roscore")
    if found is None:
        reason = "ROS 1 is not installed (Debian: python3-roslaunch, python3-rospy)"
        if "roscore" in os.environ.get("HPRS_TEST_NEEDS", "").split():
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@pytest.fixture
def ros(roscore, tmp_path):
    """A roscore on the loopback interface; gives the environment of its nodes."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    root = Path(__file__).parents[2]
    variables = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(tmp_path / "ros"),
        "PYTHONPATH": os.pathsep.join([str(root / "src"), str(root)]),
        "OMP_NUM_THREADS": "1",
    }
    variables.pop("ROS_HOSTNAME", None)
    log = (tmp_path / "roscore.log").open("w")
    core = subprocess.Popen([roscore, "-p", str(port)], env=variables, stdout=log, stderr=log)
    try:
        for _ in range(300):
            with socket.socket() as found:
                if found.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        else:
            raise AssertionError((tmp_path / "roscore.log").read_text())
        yield variables
    finally:
        core.send_signal(signal.SIGINT)
        core.wait(20)
        log.close()


@pytest.fixture
def driven(ros, tmp_path):
    """Lets the runtime drive the simulated car; gives what became of it and what the node said."""

    def attempt(kind, options):
        save_bundle(trained_bundle(), tmp_path / "policy.bundle")
        (tmp_path / NAME).write_text(runtime_source("tests"), encoding="utf-8")
        (tmp_path / "drive.csv").unlink(missing_ok=True)
        alone = {name: value for name, value in ros.items() if name != "PYTHONPATH"}
        command = [SYSTEM, NAME, "policy.bundle", "--ros1", "--log", "drive.csv", *options]
        node = subprocess.Popen(
            command,
            cwd=tmp_path,
            env=alone,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        car = subprocess.run(
            [sys.executable, str(CAR), kind], env=ros, capture_output=True, text=True, timeout=240
        )
        node.send_signal(signal.SIGINT)
        said, _ = node.communicate(timeout=30)
        lines = [line for line in car.stdout.splitlines() if line.startswith("RESULT ")]
        assert lines, car.stdout + car.stderr + said
        return json.loads(lines[0].partition(" ")[2]), said

    def drive(kind, *options):
        # A machine that stalls before the middle of the lap is stopped rightly, and shows nothing.
        for _ in range(3):
            found, said = attempt(kind, options)
            if found["progress"] > 0.4 or found["contact"]:
                break
        return found, said

    return drive


def test_the_car_drives_a_lap_over_ros_1(driven, tmp_path, capsys):
    found, said = driven("lap", "--scan-age", "2")
    assert not found["contact"], said
    assert found["progress"] >= 1, said
    assert "driving" in said
    assert "waiting: " in said
    # What was driven can be judged; of the walls nothing was said.
    log = str(tmp_path / "drive.csv")
    arguments = ["assess", log, "--task", "hprs/SafeDriving-v0", "--missing", "unknown", "--json"]
    assert main(arguments) == 0
    judged = json.loads(capsys.readouterr().out)
    assert judged["safe"] is True
    assert judged["unknown"] == ["centred"]


def test_without_scans_zero_speed_is_commanded_within_0_3_s(driven):
    found, said = driven("silence")
    assert found["stopped_after"] is not None, said
    assert found["stopped_after"] < 0.3
    # Latched: though the simulator lives, nothing else is commanded any more.
    assert found["moved_on"] is False
    assert not found["contact"]
    assert "stopped: no scan for" in said


def test_without_ros_its_absence_is_named(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "genpy", None)
    save_bundle(trained_bundle(), tmp_path / "policy.bundle")
    assert main(["drive", str(tmp_path / "policy.bundle"), "--ros1"]) == 2
    assert "there is no ROS 1 here" in capsys.readouterr().err
    assert main(["drive", str(tmp_path / "policy.bundle")]) == 2
    assert "name what the car speaks: --ros1" in capsys.readouterr().err
