"""The scripts that draw and film the driving environments: minutes of compilation."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = pytest.mark.slow


def play(*arguments: object) -> str:
    command = [sys.executable, str(EXAMPLES / "storyboard.py"), *map(str, arguments)]
    found = subprocess.run(command, capture_output=True, text=True, check=False)
    assert found.stderr == ""
    return found.stdout


def test_the_pursuing_driver_drives_a_lap_in_a_storyboard(tmp_path: Path) -> None:
    path = tmp_path / "lap.png"
    options = ("--env", "tracks=gm", "--pictures", 6, "--width", 240)
    words = play("hprs/SafeDriving-v0", "--policy", "pursuit", *options, "--out", path)
    # Before the horizon of 250 steps: a lap, for the driver hits no wall.
    assert 60 < int(words.split()[-1]) < 200
    with Image.open(path) as picture:
        assert picture.size[0] == 3 * 246 + 6


def test_the_pursuing_driver_is_filmed_behind_a_leader(tmp_path: Path) -> None:
    path = tmp_path / "film.gif"
    options = ("--env", "camera=follow", "--horizon", 20, "--width", 240)
    words = play("hprs/FollowLeader-v0", "--policy", "pursuit", *options, "--out", path)
    assert words == f"{path}: 20 steps\n"
    with Image.open(path) as film:
        assert film.n_frames == 21
        assert film.info["duration"] == 100


def test_of_three_behaviours_one_crashes_and_one_is_comfortable(tmp_path: Path) -> None:
    script = runpy.run_path(str(EXAMPLES / "three_behaviours.py"))
    task = script["task_of"](script["BENCHMARK"])
    drives = script["drive_all"](task)
    crash, uncomfortable, comfortable = drives.values()
    assert [drive.crashed for drive in drives.values()] == [True, False, False]
    for drive in (uncomfortable, comfortable):
        assert drive.progress[-1] > script["SHOWN"][1]
    limit = task.ranges["command_change"].low
    assert np.abs(crash.change).max() > limit
    assert np.abs(uncomfortable.change).max() > 1
    assert np.abs(comfortable.change).max() <= limit
    path = tmp_path / "picture.png"
    script["draw"](drives, task, path)
    assert path.stat().st_size < 150_000
