"""The script that draws the pictures of the environments' pages."""

from __future__ import annotations

import runpy
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hprs.errors import HprsError
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


def test_the_last_policy_of_a_trained_run_is_drawn(tmp_path: Path) -> None:
    [run] = create_runs([ppo(steps=96)], tmp_path)
    assert sb3.train(run, Silence())
    shutil.rmtree(run.path / "policy" / "best")
    # In this process, which has imported PyTorch already.
    script = runpy.run_path(str(SCRIPT))
    script["main"](script["Storyboard"](str(run.path), tmp_path / "picture.png", pictures=4))
    with Image.open(tmp_path / "picture.png") as picture:
        assert picture.size[0] > 1000


def test_options_reach_the_environment_that_is_drawn(tmp_path: Path) -> None:
    options = ("--policy", "zero", "--pictures", 2, "--env", "goal=4.7", "--horizon", 30)
    found = storyboard("hprs/BipedalWalker-v0", "--out", tmp_path / "picture.png", *options)
    assert found.stderr == ""
    assert int(found.stdout.split()[-1]) <= 30


@pytest.mark.parametrize("fault", ["no folder", "no file", "seeds", "option"])
def test_a_wrong_call_is_one_line(tmp_path: Path, fault: str) -> None:
    script = runpy.run_path(str(SCRIPT))
    options: dict[str, object]
    subject, options = "hprs/CartPole-v0", {"policy": "zero", "pictures": 2, "horizon": 3}
    out, message = tmp_path / "picture.png", ""
    if fault == "no folder":
        out = tmp_path / "nowhere" / "picture.png"
        message = f"there is no folder '{out.parent}' for the picture."
    elif fault == "no file":
        out.mkdir()
        message = f"cannot write {out}: Is a directory."
    elif fault == "seeds":
        runs = create_runs([replace(ppo(), seed=seed) for seed in range(2)], tmp_path)
        subject, options = str(runs[0].path.parent), {}
        message = f"'{subject}' holds 2 seeds; name one, as in {runs[0].path}"
    else:
        options["options"] = ("mass=1",)
        message = "hprs/CartPole-v0 has no option 'mass'. It has sutton_barto_reward."
    with pytest.raises(HprsError) as error:
        script["main"](script["Storyboard"](subject, out, **options))
    assert str(error.value) == message


def test_a_step_that_was_not_played_is_refused_in_one_line(tmp_path: Path) -> None:
    found = storyboard(
        "hprs/BipedalWalkerHardcore-v0", "--policy", GAIT, "--out", tmp_path / "x", "--steps", 5000
    )
    assert found.returncode == 2
    assert found.stderr.startswith("the episode has the steps 0 to ")
    assert found.stderr.count("\n") == 1
