"""A task's constants are parameters of every subcommand that reads a task."""

import json
from pathlib import Path

import pytest

from hprs.spec.parser import parse_task
from hprs.training.configure import configure
from hprs.training.run_directory import RunDirectory

QUICK = (
    "train", "hprs/CartPole-v0", "--trainer", "sb3", "--steps", "64", "--set", "n_steps=32", "--set", "batch_size=32",
)  # fmt: skip


def test_a_run_says_with_which_constants_it_was_trained(hprs):
    code, out, err = hprs(*QUICK, "--const", "mark=-1")
    assert code == 0, err
    [run] = Path("runs").glob("*/*/seed-0")
    text = json.loads((run / "run.json").read_text())["configuration"]["task_text"]
    assert "const mark = -1\n" in text
    stored = RunDirectory(run).configuration
    own = configure("hprs/CartPole-v0")
    assert stored.task == parse_task(text) == own.task.with_constants(mark=-1)
    code, out, _ = hprs("evaluate", run, "--episodes", "2", "--const", "mark=0", "--json")
    assert code == 0
    other = json.loads(out)["measures"]
    assert other != json.loads(hprs("evaluate", run, "--episodes", "2", "--json")[1])["measures"]


def test_constants_are_part_of_the_hash_and_the_same_values_are_not():
    own = configure("hprs/CartPole-v0")
    other = configure("hprs/CartPole-v0", constants={"mark": -1})
    assert other.digest != own.digest
    assert configure("hprs/CartPole-v0", constants={"mark": 1.0}).digest == own.digest


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("train", "hprs/CartPole-v0", "--const", "mark"), 2, "given as NAME=VALUE"),
        (("train", "hprs/CartPole-v0", "--const", "marc=1"), 1, "Did you mean 'mark'?"),
        (("train", "hprs/CartPole-v0", "--const", "mark=-19"), 1, "can never be satisfied"),
        (
            ("evaluate", "hprs/CartPole-v0", "--policy", "zero", "--const", "marc=1"),
            1,
            "hprs/CartPole-v0: the task has no constant 'marc'",
        ),
    ],
)
def test_wrong_constants_are_one_line(hprs, arguments, code, message):
    found, out, err = hprs(*arguments)
    assert (found, out) == (code, "")
    assert message in err
    assert err.count("\n") == 1
