import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

SMALL = [
    "--set", "environments=2", "--set", "n_steps=32", "--set", "batch_size=32",
    "--set", "n_epochs=1", "--set", "net_arch=[8]",
]  # fmt: skip
CART_POLE = ["train", "hprs/CartPole-v0", "--trainer", "sb3"]
QUICK = [*CART_POLE, "--steps", "128", "--evaluate-every", "64", *SMALL]


def runs(folder):
    return sorted(file.parent for file in Path(folder).glob("**/run.json"))


def test_train_writes_where_it_says_and_evaluate_reads_it(hprs):
    code, out, err = hprs(*QUICK)
    assert (code, err) == (0, "")
    [run] = runs("runs")
    assert f"Wrote {run}" in out
    assert "step       128  PAM " in out
    assert f"Assess it with: hprs evaluate {run}" in out
    code, out, _ = hprs("evaluate", run, "--episodes", "3", "--json")
    content = json.loads(out)
    assert code == 0
    assert content["episodes"] == 3
    assert list(content["floors"]) == ["doing nothing", "random"]
    assert list(content["measures"])[:4] == ["S", "S+T", "S+T+C", "PAM"]
    assert hprs("evaluate", run, "--episodes", "3", "--json")[1] == out


def test_who_says_nothing_gets_ppo_of_the_jax_trainer(hprs):
    options = "environments=2", "n_steps=32", "batch_size=64", "n_epochs=1", "net_arch=[8]"
    settings = [part for option in options for part in ("--set", option)]
    code, out, err = hprs("train", "hprs/CartPole-v0", "--steps", "128", *settings)
    assert (code, err) == (0, "")
    [run] = runs("runs")
    assert f"Wrote {run}" in out
    found = json.loads((run / "run.json").read_text())["configuration"]
    assert (found["trainer"], found["algorithm"]) == ("jax", "ppo")
    assert found["evaluation_interval"] == 1
    code, out, _ = hprs("evaluate", run, "--episodes", "2", "--json")
    assert code == 0
    assert json.loads(out)["episodes"] == 2
    code, out, err = hprs("train", "--resume", run)
    assert (code, err) == (0, "")
    assert "is complete: " in out


def test_several_seeds_are_pooled_with_the_worst_beside(hprs):
    code, out, _ = hprs(*QUICK, "--seeds", "2", "--out", "here")
    assert code == 0
    first, second = runs("here")
    assert [first.name, second.name] == ["seed-0", "seed-1"]
    code, out, _ = hprs("evaluate", first.parent, "--episodes", "2", "--which", "best")
    assert code == 0
    assert "4 episodes of 2 seeds" in out
    assert "worst seed" in out
    assert "The spread between seeds is not in them." in out
    content = json.loads(hprs("evaluate", first.parent, "--episodes", "2", "--json")[1])
    each = [
        json.loads(hprs("evaluate", run, "--episodes", "2", "--json")[1])["measures"]["PAM"][
            "value"
        ]
        for run in (first, second)
    ]
    assert content["measures"]["PAM"]["value"] == pytest.approx(sum(each) / 2)
    assert content["worst"]["PAM"]["value"] == pytest.approx(min(each))


def test_an_existing_run_is_refused_in_one_line(hprs):
    hprs(*QUICK)
    [run] = runs("runs")
    code, out, err = hprs(*QUICK)
    assert (code, out) == (2, "")
    assert err == (
        f"hprs: {run} exists already. Go on with it: hprs train --resume {run} "
        "(or choose another seed, or another folder with --out).\n"
    )


def test_an_environment_of_gymnasium_needs_no_registration_with_us(hprs):
    code, out, err = hprs(
        "train", "MountainCarContinuous-v0", "--task", "mountain.hprs", "--steps", "60",
        "--horizon", "30", "--algorithm", "sac", "--set", "learning_starts=10", "--set", "net_arch=[8]",
    )  # fmt: skip
    assert (code, err) == (0, "")
    [run] = runs("runs")
    assert run.parent.name.startswith("hprs-sac-")
    code, out, _ = hprs("evaluate", run, "--episodes", "2")
    assert code == 0
    assert "achieve top" in out


def test_a_module_may_register_the_environment(hprs, here):
    (here / "my_envs.py").write_text(
        "import gymnasium as gym\n"
        "gym.register('Mine-v0', 'gymnasium.envs.classic_control:Continuous_MountainCarEnv',"
        " max_episode_steps=20)\n"
    )
    code, _, err = hprs(
        "train", "my_envs:Mine-v0", "--task", "mountain.hprs", "--steps", "40", "--trainer", "sb3",
        "--set", "n_steps=20", "--set", "environments=1", "--set", "batch_size=20",
    )  # fmt: skip
    assert (code, err) == (0, "")
    [run] = runs("runs")
    assert run.parent.parent.name == "my_envs-Mine-v0"


def test_a_built_in_environment_takes_another_task(hprs, here):
    from hprs.envs import task_text_of

    text = task_text_of("hprs/CartPole-v0").replace("mark = 1.0", "mark = -1.0")
    (here / "left.hprs").write_text(text)
    assert hprs(*QUICK, "--task", "left.hprs", "--reward", "sparse")[0] == 0
    [run] = runs("runs")
    assert "mark = -1.0" in json.loads((run / "run.json").read_text())["configuration"]["task_text"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train"], "name an environment, or a run with --resume; see hprs train --help"),
        (["train", "hprs/CartPoel-v0"], "unknown environment 'hprs/CartPoel-v0'. Did you mean 'hprs/CartPole-v0'?"),
        (["train", "no_module:X-v0"], "unknown environment 'no_module:X-v0': there is no module 'no_module'."),
        (["train", "CartPole-v1"], "'CartPole-v1' has no task of its own. Give it one: --task FILE.hprs"),
        (["train", "CartPole-v1", "--task", "mountan.hprs"], "there is no task file 'mountan.hprs'. Did you mean 'mountain.hprs'?"),
        (["train", "hprs/CartPole-v0", "--reward", "hrps"], "unknown reward 'hrps'; choose one of"),
        (["train", "hprs/CartPole-v0", "--seeds", "0"], "--seeds takes a number from 1 on, and excludes --seed."),
        (["train", "hprs/CartPole-v0", "--seed", "-1"], "--seed must not be negative, got -1."),
        (["train", "hprs/CartPole-v0", "--set", "lr=1"], "ppo has no hyper-parameter 'lr'."),
        (["train", "hprs/CartPole-v0", "--algorithm", "sac"], "sac cannot handle actions of a Discrete space; choose one of ppo, a2c, dqn."),
        (["train", "hprs/CartPole-v0", "--trainer", "jaxx"], "unknown trainer 'jaxx'; choose one of jax, sb3. Did you mean 'jax'?"),
        (["train", "hprs/CartPole-v0", "--trainer", "jax", "--algorithm", "dqn"], "the trainer jax has no dqn; it has ppo, sac. For dqn: --trainer sb3."),
        (["train", "hprs/CartPole-v0", "--workers", "-1"], "--workers takes a number from 0 on, got -1."),
        (["train", "hprs/CartPole-v0", "--reward", "hprs,evn"], "unknown reward 'evn'; choose one of"),
        (["train", "hprs/CartPole-v0", "--end", "paper,invarian"], "unknown end 'invarian'; choose one of paper, invariant, released. Did you mean 'invariant'?"),
        (["train", "hprs/CartPole-v0", "--reward", "hprs,env", "--reward-set", "window=3"], "none of the rewards hprs, env has 'window'."),
        (["train", "--resume", "runs/x"], "there is no run 'runs/x'."),
        (["train", "--resume", "runs/x", "--steps", "3"], "--resume takes no other option: a run keeps its configuration."),
        (["evaluate", "runs/x"], "there is no run 'runs/x'."),
        (["evaluate", "hprs/CartPole-v0"], "'hprs/CartPole-v0' is an environment: name a policy too, as in --policy random."),
        (["evaluate", "runs/x", "--which", "lst"], "--which is last or best, not 'lst'. Did you mean 'last'?"),
        (["evaluate", "runs/x", "--episodes", "0"], "--episodes must be at least 1, got 0."),
        (["evaluate", "hprs/CartPole-v0", "--policy", "radnom"], "unknown policy 'radnom'; it is zero, random, a .bundle file, a .zip of Stable-Baselines3, an .onnx file, or module:function. Did you mean 'random'?"),
        (["evaluate", "hprs/CartPole-v0", "--policy", "x.zip"], "there is no policy file 'x.zip'."),
        (["evaluate", "hprs/CartPole-v0", "--policy", "json:loadz"], "policy 'json:loadz': module 'json' has no function 'loadz'."),
    ],
)  # fmt: skip
def test_a_wrong_call_is_one_line_and_exits_with_2(hprs, arguments, message):
    code, out, err = hprs(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"hprs: {message}")
    assert err.count("\n") == 1


def test_a_task_that_does_not_fit_the_environment_exits_with_1(hprs, here):
    (here / "wide.hprs").write_text("signal x = obs[9] in [0, 1]\nensure low: x <= 0.5\n")
    code, _, err = hprs("train", "CartPole-v1", "--task", "wide.hprs")
    assert code == 1
    assert err.startswith("hprs: signal 'x' reads obs[9]")
    assert err.count("\n") == 1


def test_a_missing_extra_says_how_to_install_it(hprs, monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    code, _, err = hprs("train", "hprs/CartPole-v0")
    assert (code, err) == (
        2,
        "hprs: jax is not installed. Install it with: pip install 'hprs[jax]'\n",
    )
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    code, _, err = hprs(*CART_POLE)
    assert code == 2
    assert err == (
        "hprs: stable-baselines3 is not installed. Install it with: pip install 'hprs[sb3]'\n"
    )


@pytest.mark.parametrize("policy", ["zero", "random", "my_policies:right"])
def test_any_policy_is_evaluated_on_any_environment(hprs, here, policy):
    (here / "my_policies.py").write_text("def right(observation):\n    return [1.0]\n")
    code, out, err = hprs(
        "evaluate", "MountainCarContinuous-v0", "--task", "mountain.hprs", "--policy", policy,
        "--episodes", "2", "--horizon", "50",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert f"MountainCarContinuous-v0, policy {policy}: 2 episodes" in out
    assert "encourage gentle" in out


def test_ctrl_c_saves_and_says_how_to_go_on(here):
    arguments = [*CART_POLE, "--steps", "4000", "--evaluate-every", "64", *SMALL]
    with subprocess.Popen(
        [sys.executable, "-m", "hprs", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        next(line for line in process.stdout if line.startswith("step"))
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
    [run] = runs("runs")
    assert process.returncode == 130
    assert rest.splitlines()[-1] == f"Stopped. Go on with: hprs train --resume {run}"
    assert (run / "checkpoint" / "model.zip").is_file()
    assert "Traceback" not in rest
