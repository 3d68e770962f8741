"""The demo, as a user without PyTorch runs it: one real training of the car."""

import re
import subprocess
import sys
from pathlib import Path

from PIL import Image

DEMO = Path(__file__).parents[2] / "examples" / "demo.py"
WITHOUT_PYTORCH = """
import runpy, sys

class Without:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in ("torch", "stable_baselines3"):
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Without())
script, *sys.argv[1:] = sys.argv[1:]
sys.path.insert(0, script.rpartition("/")[0])
runpy.run_path(script, run_name="__main__")
"""


def test_a_car_learns_to_drive_laps_without_pytorch(tmp_path):
    options = ["--steps", "300000", "--out", str(tmp_path / "demo")]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_PYTORCH, str(DEMO), *options],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    row = re.search(r"^S\+T +(\d\.\d+) .* (\d\.\d+) +(\d\.\d+)$", done.stdout, re.MULTILINE)
    assert row is not None, done.stdout
    learned, nothing, random = map(float, row.groups())
    assert learned >= 0.9
    assert nothing == random == 0.0
    with Image.open(tmp_path / "demo" / "episode.gif") as film:
        # A lap takes from 10 to 40 s; the film has all of it, in steps of 0.1 s.
        assert 50 < film.n_frames <= 500
    with Image.open(tmp_path / "demo" / "learning_curve.png") as curve:
        assert min(curve.size) > 400
