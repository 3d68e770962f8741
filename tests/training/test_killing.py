"""`kill -9` at any moment loses nothing; the killing itself is in `killing.py`."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs fork and SIGKILL")


def kill(folder, *arguments):
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", "tests.training.killing", str(folder), *map(str, arguments)],
        cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    print(done.stdout)


def test_a_training_survives_kills_at_random_moments(tmp_path):
    kill(tmp_path, "random", "sac", 3, 1)


@pytest.mark.parametrize(("kind", "stride"), [("ppo", 23), ("sac", 37)])
def test_a_training_survives_a_kill_at_changes_of_the_disk(tmp_path, kind, stride):
    kill(tmp_path, "each", kind, stride)


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["long ppo", "long sac"])
def test_a_real_training_survives_20_kills_at_random_moments(tmp_path, kind):
    kill(tmp_path, "random", kind, 20, 2)


@pytest.mark.soak
@pytest.mark.parametrize("kind", ["ppo", "sac"])
def test_a_training_survives_a_kill_at_every_change_of_the_disk(tmp_path, kind):
    kill(tmp_path, "each", kind, 1)
