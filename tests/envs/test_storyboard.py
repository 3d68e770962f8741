"""The script that draws the pictures of the environments' pages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hprs.training import sb3
from hprs.training.listener import Silence
from hprs.training.run_directory import create_runs
from tests.training.small import ppo

SCRIPT = Path(__file__).parents[2] / "examples" / "storyboard.py"
GAIT = "hprs.envs.bipedal_walker.gait:walk"


def storyboard(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_an_environment_with_a_policy_is_drawn(tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    options = ("--policy", "zero", "--pictures", 3)
    found = storyboard("hprs/LunarLanderObstacle-v0", "--out", path, *options)
    assert found.stderr == ""
    assert found.stdout.startswith(f"{path}: steps 0, ")
    with Image.open(path) as image:
        picture = np.asarray(image.convert("RGB")).astype(int)
    red = (picture[..., 0] > 180) & (picture[..., 1:].max(axis=-1) < 80)
    # One obstacle in each of the three pictures, side by side.
    assert all(part.sum() > 100 for part in np.array_split(red[:200], 3, axis=1))


@pytest.mark.slow
def test_a_trained_run_is_drawn(tmp_path: Path) -> None:
    [run] = create_runs([ppo()], tmp_path)
    assert sb3.train(run, Silence())
    found = storyboard(run.path, "--which", "last", "--out", tmp_path / "picture.png")
    assert found.stderr == ""
    with Image.open(tmp_path / "picture.png") as picture:
        assert picture.size[0] > 1000


def test_a_step_that_was_not_played_is_refused_in_one_line(tmp_path: Path) -> None:
    found = storyboard(
        "hprs/BipedalWalkerHardcore-v0", "--policy", GAIT, "--out", tmp_path / "x", "--steps", 5000
    )
    assert found.returncode == 2
    assert found.stderr.startswith("the episode has the steps 0 to ")
    assert found.stderr.count("\n") == 1
