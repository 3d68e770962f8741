"""`hprs train --reward`: every reward, its options, and what it asks of the learner."""

import json
from pathlib import Path

import pytest

from hprs.rewards import REWARDS

SMALL = [
    "--set", "environments=2", "--set", "n_steps=16", "--set", "batch_size=16",
    "--set", "n_epochs=1", "--set", "net_arch=[8]",
]  # fmt: skip
QUICK = [
    "train",
    "hprs/CartPole-v0",
    "--trainer",
    "sb3",
    "--steps",
    "32",
    "--evaluate-every",
    "32",
    *SMALL,
]
WEIGHTS = ["--reward-set", "weights=[1, 1, 0.5, 0.25, 0.25]"]


def configuration():
    [file] = Path().glob("**/run.json")
    return json.loads(file.read_text())["configuration"]


@pytest.mark.parametrize("name", [name for name in REWARDS if name != "vector"])
def test_every_reward_trains(hprs, name):
    code, out, err = hprs(*QUICK, "--reward", name, *(WEIGHTS if name == "morl" else []))
    assert (code, err) == (0, "")
    episodic = name in ("tltl", "pam", "rank-preserving")
    parameters = configuration()["parameters"]
    assert (parameters["gamma"] == 1.0) == episodic
    assert parameters["horizon_is_terminal"] == episodic
    assert (f"The reward {name} asks for gamma=1.0.\n" in out) == episodic
    assert (f"The reward {name} asks for horizon_is_terminal=true.\n" in out) == episodic


def test_what_is_set_goes_over_what_a_reward_asks_for(hprs):
    more = ["--set", "gamma=0.9", "--reward-set", "margins=raw"]
    code, out, err = hprs(*QUICK, "--reward", "tltl", *more)
    assert (code, err) == (0, "")
    assert "The reward tltl asks for gamma=1.0, but it was set to 0.9.\n" in out
    found = configuration()
    assert found["parameters"]["gamma"] == 0.9
    assert found["reward_options"] == {"margins": "raw"}


def test_options_of_a_reward_are_part_of_the_configuration(hprs):
    reward = [*QUICK, "--reward", "bhnr"]
    assert hprs(*reward)[0] == 0
    assert hprs(*reward, "--reward-set", "window=25")[0] == 0
    assert hprs(*reward, "--reward-set", "form=boolean")[0] == 0
    assert len(list(Path().glob("**/run.json"))) == 3


@pytest.mark.parametrize(
    ("reward", "message"),
    [
        (["vector"], "the reward vector pays one number a requirement, and the trainers learn from one number. Train on morl, or use hprs.wrap with a multi-objective learner."),
        (["morl"], "the reward morl needs the option weights: one number for each of on_track, pole_up, parked, upright, slow."),
        (["morl", "weights=[1]"], "the task has 5 requirements (on_track, pole_up, parked, upright, slow), got 1 weights."),
        (["morl", "weights=[1,1,1,1,-1]"], "the weight of 'slow' must be a finite number that is not negative, got -1."),
        (["morl", 'weights={"slow":NaN,"on_track":1,"pole_up":1,"parked":1,"upright":1}'], "the weight of 'slow' must be a finite number that is not negative, got nan."),
        (["bhnr", "window=0"], "window is a whole number of steps from 1 on, got 0."),
        (["bhnr", "window=501"], "window must be at most the horizon of 500 steps, got 501."),
        (["tltl", "margin=raw"], "the reward tltl has no option 'margin'. Did you mean 'margins'?"),
        (["tltl", "margins"], "--reward-set takes KEY=VALUE, got 'margins'."),
    ],
)  # fmt: skip
def test_wrong_options_are_one_line(hprs, reward, message):
    name, *options = reward
    pairs = (part for option in options for part in ("--reward-set", option))
    code, _, err = hprs(*QUICK, "--reward", name, *pairs)
    assert (code, err) == (2, f"hprs: {message}\n")
    assert not Path("runs").exists()


def test_help_lists_the_options_of_rewards(hprs):
    _, out, _ = hprs("train", "--help")
    text = " ".join(out.replace("│", " ").split())
    for name, kind in REWARDS.items():
        if kind.options:
            assert f"{', '.join(kind.options)} of {name}" in text
