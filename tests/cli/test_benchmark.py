"""`hprs benchmark`: plan, train, skip, go on, report."""

import json
from pathlib import Path

import pytest

GRID = """
[defaults]
steps = 32
evaluate_every = 32
trainer = "sb3"
seeds = 2
set = {{ environments = 2, n_steps = 16, batch_size = 16, n_epochs = 1, net_arch = [4] }}

[[runs]]
environment = "hprs/CartPole-v0"
reward = ["hprs", "env"]
{more}
"""


@pytest.fixture
def grid(here):
    def write(more=""):
        (here / "grid.toml").write_text(GRID.format(more=more))
        return "grid.toml"

    return write


def runs():
    return sorted(Path("runs").glob("*/*/seed-*"))


def test_a_dry_run_says_what_is_to_be_done_and_makes_nothing(hprs, grid):
    code, out, err = hprs("benchmark", grid(), "--dry-run")
    assert (code, err) == (0, "")
    assert out.startswith("4 runs\n")
    assert "128 steps are left, 1 side by side." in out
    assert "Estimated: " in out
    assert not Path("runs").exists()


def test_every_run_is_trained_once(hprs, grid):
    code, out, err = hprs("benchmark", grid(), "--workers", "1")
    assert (code, err) == (0, "")
    assert out.count("  done  PAM") == 4
    assert out.endswith("4 of 4 runs are done, in runs.\nShow them with: hprs report runs\n")
    assert len(runs()) == 4
    before = {path: path.stat().st_mtime_ns for path in Path("runs").rglob("*") if path.is_file()}
    code, out, _ = hprs("benchmark", grid())
    assert (code, "All 4 runs are done." in out) == (0, True)
    after = {path: path.stat().st_mtime_ns for path in Path("runs").rglob("*") if path.is_file()}
    assert before == after


def test_what_hprs_train_has_trained_is_taken_over(hprs, grid):
    small = [
        "--trainer", "sb3", "--evaluate-every", "32", "--steps", "32", "--set", "environments=2",
        "--set", "n_steps=16", "--set", "batch_size=16", "--set", "n_epochs=1",
        "--set", "net_arch=[4]",
    ]  # fmt: skip
    assert hprs("train", "hprs/CartPole-v0", "--reward", "env", "--seed", "1", *small)[0] == 0
    code, out, _ = hprs("benchmark", grid(), "--workers", "1")
    assert code == 0
    assert out.count("  done  PAM") == 3
    assert len(runs()) == 4


def test_a_failure_is_reported_and_does_not_stop_the_rest(hprs, grid):
    assert hprs("benchmark", grid(), "--workers", "1")[0] == 0
    wrong, *_ = (path for path in runs() if "env-" in str(path))
    for policy in wrong.glob("policy/last"):
        # As if it had been interrupted, and its checkpoint damaged.
        content = json.loads((policy / "policy.json").read_text())
        (policy / "policy.json").write_text(json.dumps({**content, "step": 16}))
    (wrong / "checkpoint" / "manifest.json").write_text("{")
    code, out, err = hprs("benchmark", grid("\n[[runs]]\nenvironment = 'hprs/CartPole-v0'\nreward = 'sparse'"))  # fmt: skip
    assert (code, err) == (1, "")
    assert f"Failed: {wrong}: " in out
    assert "5 of 6 runs are done, in runs.\n" in out


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("gone.toml",), 2, "there is no grid 'gone.toml'"),
        (("grid.toml", "--workers", "-1"), 2, "--workers takes a number from 0 on, got -1."),
        (("wrong.toml",), 1, "wrong.toml: unknown key 'run'. Did you mean 'runs'?"),
    ],
)
def test_mistakes_are_explained(hprs, grid, here, arguments, code, message):
    grid()
    (here / "wrong.toml").write_text("[[run]]\n")
    found, out, err = hprs("benchmark", *arguments)
    assert (found, out) == (code, "")
    assert err.startswith(f"hprs: {message}")
