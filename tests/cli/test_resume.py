import json
from pathlib import Path

import pytest

SMALL = [
    "--steps", "64", "--evaluate-every", "64", "--set", "environments=2", "--set", "n_steps=32",
    "--set", "batch_size=32", "--set", "n_epochs=1", "--set", "net_arch=[8]",
]  # fmt: skip
QUICK = ["train", "hprs/CartPole-v0", "--trainer", "sb3", *SMALL]


@pytest.fixture
def mine(here):
    (here / "my_poles.py").write_text(
        "import gymnasium as gym\n"
        "from gymnasium.envs.classic_control import CartPoleEnv\n"
        "class Pole(CartPoleEnv):\n"
        "    def __init__(self, render_mode=None, *, length=0.5, name='pole'):\n"
        "        super().__init__(render_mode=render_mode)\n"
        "        if not length > 0:\n"
        "            raise ValueError(f'length must be positive, got {length}')\n"
        "        self.length = length\n"
        "        print('length', length)\n"
        "gym.register('Pole-v0', Pole, max_episode_steps=20)\n"
    )
    (here / "pole.hprs").write_text("signal x = obs[0] in [-5, 5]\nensure near: abs(x) <= 2\n")
    return ["train", "my_poles:Pole-v0", "--task", "pole.hprs", "--trainer", "sb3", *SMALL]


def runs():
    return sorted(file.parent for file in Path("runs").glob("**/run.json"))


def test_a_complete_run_says_so(hprs):
    hprs(*QUICK)
    [run] = runs()
    code, out, err = hprs("train", "--resume", run)
    assert (code, err) == (0, "")
    assert out.splitlines() == [
        f"{run} is complete: 64 steps.",
        f"Assess it with: hprs evaluate {run}",
    ]


def test_a_run_in_the_place_of_an_environment_is_pointed_to_resume(hprs):
    hprs(*QUICK)
    [run] = runs()
    for place in (run, run.parent):
        code, _, err = hprs("train", place)
        assert code == 2
        assert err == f"hprs: '{place}' is a run. Go on with it: hprs train --resume {place}\n"


def test_a_broken_run_is_one_line_and_exits_with_2(hprs):
    hprs(*QUICK)
    [run] = runs()
    (run / "checkpoint" / "model.zip").write_bytes(b"x")
    code, out, err = hprs("train", "--resume", run)
    assert (code, out) == (2, "")
    assert err.startswith(
        f"hprs: {run}/checkpoint/model.zip is damaged. This training cannot go on;"
    )
    assert err.count("\n") == 1
    assert hprs("evaluate", run, "--episodes", "1")[0] == 0


def test_options_reach_the_environment_its_evaluation_and_run_json(hprs, mine):
    code, out, err = hprs(*mine, "--env", "length=0.75")
    assert (code, err) == (0, "")
    assert "length 0.75" in out
    [run] = runs()
    configuration = json.loads((run / "run.json").read_text())["configuration"]
    assert configuration["environment_options"] == {"length": 0.75}
    code, out, _ = hprs("evaluate", run, "--episodes", "1")
    assert code == 0
    assert "length 0.75" in out
    assert "length 0.5" not in out
    code, out, err = hprs(
        "evaluate", run, "--episodes", "1", "--env", "length=1.25", "--env", "name=x"
    )
    assert (code, err) == (0, "")
    assert "length 1.25" in out
    code, out, err = hprs("evaluate", run, "--episodes", "1", "--env", "leength=1.25")
    assert (code, out) == (2, "length 0.5\n")
    assert err == "hprs: my_poles:Pole-v0 has no option 'leength'. Did you mean 'length'?\n"
    named = ("evaluate", "my_poles:Pole-v0", "--task", "pole.hprs", "--policy", "zero")
    code, out, err = hprs(*named, "--episodes", "1", "--env", "length=2.5")
    assert (code, err) == (0, "")
    assert "length 2.5" in out
    assert hprs(*mine)[0] == 0
    assert len(runs()) == 2, "another option is another configuration"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["leength=1"], "my_poles:Pole-v0 has no option 'leength'. Did you mean 'length'?"),
        (["weight=1"], "my_poles:Pole-v0 has no option 'weight'. It has length, name."),
        (["max_episode_steps=9"], "my_poles:Pole-v0 has no option 'max_episode_steps'. Use --horizon."),
        (["render_mode=human"], "my_poles:Pole-v0 has no option 'render_mode'. It has length, name."),
        (["length=-1", "name=x"], "my_poles:Pole-v0 refuses its options length=-1, name='x': length must be positive, got -1"),
        (["length"], "--env takes KEY=VALUE, got 'length'."),
        (["length=1", "length=2"], "--env length is given twice."),
    ],
)  # fmt: skip
def test_a_wrong_option_is_one_line(hprs, mine, options, message):
    code, _, err = hprs(*mine, *(part for option in options for part in ("--env", option)))
    assert code == 2
    assert err == f"hprs: {message}\n"
    assert not runs()


def test_help_names_what_exists(hprs):
    from hprs.rewards.registry import REWARDS
    from hprs.rewards.shaping import ENDS
    from hprs.training.algorithms import ALGORITHMS, OURS
    from hprs.training.configuration import Configuration
    from hprs.training.ppo.settings import HYPERPARAMETERS

    _, out, _ = hprs("train", "--help")
    text = " ".join(out.replace("│", " ").split())
    for names in (REWARDS, ALGORITHMS, OURS, HYPERPARAMETERS):
        assert ", ".join(names) in text
    assert all(f" {end} (" in text for end in ENDS)
    # A line may be broken behind a comma.
    assert f"withsb3{Configuration.evaluation_interval:,}." in text.replace(" ", "")
