"""The runtime is one file that NumPy runs, and it acts as hprs.deploy does, bit for bit."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hprs.deploy import ChoiceLayout, ObservationLayout, load_bundle, runtime, save_bundle
from hprs.deploy.archive import to_bytes
from hprs.deploy.runtime import NAME, runtime_source
from tests.deploy.small import archive, box, checked, forged, numbers, parts, small

RESULTS = Path(__file__).parents[2] / "results" / "ppo"
ALONE = """
import sys
sys.path[:0] = [{packages!r}, {folder!r}]
import numpy
before = set(sys.modules)
import policy_runtime as runtime
new = {{name.partition(".")[0] for name in set(sys.modules) - before}}
foreign = new - set(sys.stdlib_module_names) - {{"policy_runtime", "numpy"}}
assert not foreign, foreign
bundle = runtime.load_bundle("policy.bundle")
bundle.self_check()
numpy.save("found.npy", bundle.batch(numpy.load("seen.npy")))
"""
"""Without site, so that no installed package and no .pth file is seen but NumPy."""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / NAME).write_text(runtime_source("hprs of the tests"), encoding="utf-8")
    return tmp_path


def run(folder, *arguments):
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )


def only_numpy(folder):
    """A folder in which NumPy alone is installed."""
    packages = folder / "packages"
    packages.mkdir()
    home = Path(np.__file__).parent
    for part in (home, home.with_name("numpy.libs")):
        if part.exists():
            os.symlink(part, packages / part.name)
    return str(packages)


BUNDLES = {
    "choice": small(action=ChoiceLayout(2, start=3)),
    "clip": small(observation=ObservationLayout((2,), numbers(1, 0), numbers(2, 0.5), 5.0)),
    "tanh": small(action=box(mapping="tanh"), activation="tanh"),
    "raw": small(action=box(mapping="raw", high=(2.0, float("inf")))),
}


@pytest.mark.parametrize("kind", BUNDLES)
def test_with_numpy_alone_it_acts_as_the_package_does_bit_for_bit(folder, kind):
    bundle = checked(BUNDLES[kind])
    seen = np.random.default_rng(0).normal(size=(1000, 2)).astype(np.float32)
    save_bundle(bundle, folder / "policy.bundle")
    np.save(folder / "seen.npy", seen)
    code = ALONE.format(packages=only_numpy(folder), folder=str(folder))
    done = run(folder, "-I", "-S", "-c", code)
    assert done.returncode == 0, done.stderr
    found, wanted = np.load(folder / "found.npy"), bundle.batch(seen)
    assert found.dtype == wanted.dtype
    assert found.tobytes() == wanted.tobytes()


def test_a_trained_policy_acts_the_same_in_it(folder):
    bundle = load_bundle(RESULTS / "cartpole" / "hprs-paper-seed-0.bundle")
    seen = np.random.default_rng(1).normal(size=(1000, 4)).astype(np.float32)
    save_bundle(bundle, folder / "policy.bundle")
    np.save(folder / "seen.npy", seen)
    done = run(
        folder, "-I", "-S", "-c", ALONE.format(packages=only_numpy(folder), folder=str(folder))
    )
    assert done.returncode == 0, done.stderr
    assert np.load(folder / "found.npy").tobytes() == bundle.batch(seen).tobytes()


def vermin(folder, file):
    """The exit code of a check that Python 3.8 or later runs a file."""
    return run(folder, "-c", "import vermin; vermin.main()", "-t=3.8-", file).returncode


def test_python_3_8_runs_it(folder):
    assert vermin(folder, NAME) == 0
    (folder / "newer.py").write_text("match 1:\n    case 1:\n        pass\n")
    assert vermin(folder, "newer.py") == 1


def test_its_command_checks_a_bundle_and_says_what_it_is(folder):
    save_bundle(checked(), folder / "policy.bundle")
    done = run(folder, NAME, "policy.bundle")
    assert (done.returncode, done.stderr) == (0, "")
    assert "observation    shape (2,)" in done.stdout
    assert "self-check     passed" in done.stdout


def test_its_command_refuses_what_is_not_whole(folder):
    bundle = checked()
    files = parts(to_bytes(bundle))
    files["bundle.json"] = files["bundle.json"].replace(b"10.0", b"20.0")
    wrong = {
        "changed": (archive(**files), "it was changed after it was written"),
        "other": (
            forged(bundle, arrays={"weights-1": bundle.layers[1].weights * 1.01}),
            "self-check failed",
        ),
    }
    for name, (data, message) in wrong.items():
        (folder / name).write_bytes(data)
        done = run(folder, NAME, name)
        assert done.returncode == 1
        assert message in done.stderr
        assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("TOLERANCE = 1", "both define TOLERANCE"),
        ("from hprs.deploy.runtime import NAME", "does not stand before it"),
        ("from hprs.errors import HprsError as Mistake", "under another name"),
        ("def f():\n    from hprs.errors import HprsError", "inside a function"),
    ],
)
def test_what_cannot_stand_in_one_file_is_refused(monkeypatch, tmp_path, text, message):
    plain = runtime._file
    extra = tmp_path / "extra.py"
    extra.write_text('"""More."""\n\n' + text + "\n")
    monkeypatch.setattr(runtime, "MODULES", (*runtime.MODULES, "deploy.extra"))
    monkeypatch.setattr(runtime, "_file", lambda m: extra if m == "deploy.extra" else plain(m))
    with pytest.raises(ValueError, match=message):
        runtime_source("tests")
