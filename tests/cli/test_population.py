"""`hprs train` with several seeds, rewards and ends."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hprs.training.population_file import read_population

SMALL = [
    "--trainer", "sb3", "--evaluate-every", "32", "--set", "environments=2", "--set", "n_steps=16",
    "--set", "batch_size=16", "--set", "n_epochs=1", "--set", "net_arch=[4]",
]  # fmt: skip
TRAIN = ["train", "hprs/CartPole-v0", *SMALL]
QUICK = [*TRAIN, "--steps", "32"]


def configurations():
    files = sorted(Path("runs").glob("**/run.json"))
    return [json.loads(file.read_text())["configuration"] for file in files]


def populations():
    return sorted(Path("runs").glob("*/population-*.json"))


def test_every_reward_is_trained_with_every_end_that_matters_to_it(hprs):
    code, out, err = hprs(*QUICK, "--reward", "hprs,env,tltl", "--end", "paper,released", "--seeds", "2")  # fmt: skip
    assert (code, err) == (0, "")
    found = [(c["reward"], c["end"], c["seed"]) for c in configurations()]
    assert sorted(found) == sorted(
        (reward, end, seed)
        for reward, end in (("hprs", "paper"), ("hprs", "released"), ("env", "paper"), ("tltl", "paper"))
        for seed in (0, 1)
    )  # fmt: skip
    assert len(read_population(populations()[0])) == len(found) == 8
    assert out.startswith("The reward tltl asks for gamma=1.0.\n")
    assert "hprs/CartPole-v0, ppo: 8 runs, 256 steps\n" in out
    assert out.count("step        32  PAM") == 8
    assert "hprs released seed 1  step        32" in out
    assert "\nenv seed 0  step        32" in out
    assert out.count("Assess 2 runs with: hprs evaluate runs/") == 4


def test_a_single_run_is_no_population(hprs):
    assert hprs(*QUICK, "--end", "paper,released", "--reward", "env")[0] == 0
    assert len(configurations()) == 1
    assert not populations()


def test_options_go_to_the_rewards_that_have_them(hprs):
    assert hprs(*QUICK, "--reward", "bhnr,tltl,hprs", "--reward-set", "margins=raw")[0] == 0
    found = {c["reward"]: c["reward_options"] for c in configurations()}
    assert found == {"bhnr": {}, "tltl": {"margins": "raw"}, "hprs": {}}


def test_a_population_is_a_run_for_evaluation_where_only_the_seeds_differ(hprs):
    hprs(*QUICK, "--seeds", "2")
    code, out, _ = hprs("evaluate", populations()[0], "--episodes", "1")
    assert code == 0
    assert "2 episodes of 2 seeds" in out
    hprs(*QUICK, "--reward", "sparse,env")
    mixed = next(p for p in populations() if len({m.parent for m in read_population(p)}) == 2)
    code, _, err = hprs("evaluate", mixed, "--episodes", "1")
    assert code == 2
    assert f"the runs in '{mixed}' differ in more than the seed" in err
    code, _, err = hprs("train", mixed)
    assert (code, err) == (2, f"hprs: '{mixed}' is a run. Go on with it: hprs train --resume {mixed}\n")  # fmt: skip


def test_resuming_a_member_resumes_all(hprs):
    hprs(*QUICK, "--seeds", "3")
    [population] = populations()
    members = read_population(population)
    whole = [(member / "evaluations.csv").read_text() for member in members]
    for member in members[1:]:
        subprocess.run(["rm", "-r", member / "checkpoint", member / "policy"], check=True)
        lines = (member / "evaluations.csv").read_text().splitlines(keepends=True)
        (member / "evaluations.csv").write_text(lines[0])
    for place in (members[1], members[0].parent, population):
        code, out, err = hprs("train", "--resume", place)
        assert (code, err) == (0, "")
        first = f"{place} is of {population}: all its runs go on.\n"
        assert out.startswith(first) == (place != population)
        assert f"seed 0  {members[0]} is complete: 32 steps.\n" in out
    assert [(member / "evaluations.csv").read_text() for member in members] == whole


def test_a_member_that_cannot_be_trained_does_not_stop_the_others(hprs):
    code, out, _ = hprs(*QUICK, "--seeds", "3", "--set", "vf_coef=1e300")
    assert code == 1
    assert out.count("  failed: the training diverged before step ") == 3
    assert out.splitlines()[-1] == "3 of 3 trainings failed."
    hprs(*QUICK, "--seeds", "2")
    members = next(m for p in populations() if len(m := read_population(p)) == 2)
    (members[0] / "checkpoint" / "model.zip").write_bytes(b"x")
    code, out, err = hprs("train", "--resume", members[1])
    assert (code, err) == (1, "")
    failed = f"Failed: {members[0]}: {members[0]}/checkpoint/model.zip is damaged. This training"
    assert any(line.startswith(failed) for line in out.splitlines())
    assert f"Assess 1 run with: hprs evaluate {members[0].parent}" in out
    assert out.splitlines()[-1] == "1 of 2 trainings failed."


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_stops_all_and_says_how_to_go_on(here, process, workers):
    arguments = [*TRAIN, "--steps", "4000", "--seeds", "3", "--workers", str(workers)]
    with subprocess.Popen(
        [sys.executable, "-m", "hprs", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as training:
        begun = set()
        for line in training.stdout:
            begun |= {line[:6]} if "step" in line and line.startswith("seed") else set()
            if len(begun) == workers:
                break
        training.send_signal(signal.SIGINT)
        rest = training.stdout.read()
    [population] = populations()
    assert training.returncode == 130
    assert rest.splitlines()[-1] == f"Stopped. Go on with: hprs train --resume {population}"
    assert "Traceback" not in rest
    assert "failed" not in rest
    members = read_population(population)
    stopped = [member for member in members if (member / "checkpoint" / "model.zip").is_file()]
    assert len(stopped) == workers
