import json
import signal
import subprocess
import sys
import time

import pytest
from rich.console import Console

from hprs.cli.progress import EvaluationProgress
from hprs.envs import BENCHMARKS
from hprs.training import evaluation

CART_POLE = "hprs/CartPole-v0"


@pytest.mark.parametrize("policy", ["zero", "random"])
@pytest.mark.parametrize("name", BENCHMARKS)
def test_the_floors_of_every_benchmark_are_measured(hprs, name, policy):
    code, out, err = hprs(
        "evaluate", name, "--policy", policy, "--episodes", "1", "--horizon", "30", "--json"
    )
    assert (code, err) == (0, "")
    content = json.loads(out)
    assert list(content["floors"]) == [{"zero": "random", "random": "doing nothing"}[policy]]
    assert set(content["measures"]) > {"S", "S+T", "S+T+C", "PAM"}


@pytest.mark.parametrize("value", ["0", "-1"])
@pytest.mark.parametrize("option", ["--horizon", "--episodes"])
def test_counts_start_at_one(hprs, option, value):
    code, out, err = hprs("evaluate", CART_POLE, "--policy", "zero", option, value)
    assert (code, out) == (2, "")
    assert err == f"hprs: {option} must be at least 1, got {value}.\n"


def test_options_and_horizon_make_the_environment_of_a_named_policy(hprs):
    pytest.importorskip("Box2D")
    arguments = ("evaluate", "hprs/BipedalWalker-v0", "--policy", "zero", "--episodes", "1")
    far = ("--env", "goal=55.4", "--horizon", "1000", "--json")
    code, out, err = hprs(*arguments, *far)
    assert (code, err) == (0, "")
    assert json.loads(out)["subject"] == "hprs/BipedalWalker-v0, policy zero"
    for option, message in (
        ("goal=99", "goal must lie beyond the start at 4.67 and at most at the end of the field"),
        ("goal=abc", "goal needs a number, got 'abc'."),
        ("gaol=5", "hprs/BipedalWalker-v0 has no option 'gaol'. Did you mean 'goal'?"),
    ):
        code, out, err = hprs(*arguments, "--env", option)
        assert (code, out) == (2, "")
        assert err.startswith(f"hprs: {message}")


def test_a_policy_that_cannot_act_exits_with_1(hprs, here):
    (here / "strange_policies.py").write_text("def none(observation):\n    return None\n")
    code, out, err = hprs("evaluate", CART_POLE, "--policy", "strange_policies:none")
    assert (code, out) == (1, "")
    assert err == (
        "hprs: policy 'strange_policies:none' returned None, which is no action of Discrete(2).\n"
    )


def test_a_policy_of_another_environment_exits_with_1(hprs, here):
    from stable_baselines3 import PPO

    PPO("MlpPolicy", "CartPole-v1", n_steps=8, batch_size=8, device="cpu").save("cart.zip")
    code, out, err = hprs(
        "evaluate", "MountainCarContinuous-v0", "--task", "mountain.hprs", "--policy", "cart.zip"
    )
    assert (code, out) == (1, "")
    assert err.startswith("hprs: policy 'cart.zip' was trained with observations of Box(")
    assert err.count("\n") == 1


def test_without_statistics_no_episode_is_run(hprs, monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    monkeypatch.setattr(evaluation, "evaluate", None)
    code, _, err = hprs("evaluate", CART_POLE, "--policy", "zero")
    assert code == 2
    assert err == "hprs: scipy is not installed. Install it with: pip install 'hprs[report]'\n"


def test_a_terminal_gets_a_bar_over_all_policies(tmp_path):
    path = tmp_path / "screen"
    with path.open("w") as file:
        console = Console(file=file, force_terminal=True, width=100)
        with EvaluationProgress(console, policies=2, episodes=5) as progress:
            progress.watcher("doing nothing")(5)
            progress.watcher("random")(1)
    screen = path.read_text()
    assert "random" in screen
    assert "5/10 episodes" in screen


def test_ctrl_c_is_a_clean_line(here):
    (here / "slow_policies.py").write_text(
        "import time\n"
        "def slow(observation):\n"
        "    open('running', 'w').close()\n"
        "    time.sleep(0.01)\n"
        "    return 0\n"
    )
    arguments = ["evaluate", CART_POLE, "--policy", "slow_policies:slow", "--episodes", "300"]
    with subprocess.Popen(
        [sys.executable, "-m", "hprs", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        deadline = time.monotonic() + 60
        while not (here / "running").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (130, "", "hprs: interrupted.\n")
    assert time.monotonic() - start < 5


def test_a_bundle_is_assessed_where_it_was_trained(hprs, here):
    train = ("train", CART_POLE, "--steps", "2048", "--set", "n_steps=64", "--const", "mark=-1")
    assert hprs(*train, "--horizon", "40", "--workers", "1")[0] == 0
    (run,) = (here / "runs").glob("*/*/seed-0")
    bundle = run / "policy" / "last" / "policy.bundle"
    found = []
    for subject in (run, bundle, bundle.parent):
        code, out, err = hprs("evaluate", subject, "--episodes", "4", "--json")
        assert (code, err) == (0, "")
        found.append(json.loads(out))
    assert found[0]["measures"] == found[1]["measures"] == found[2]["measures"]
    assert found[0]["floors"] == found[1]["floors"]
    assert found[1]["subject"] == f"{CART_POLE}, policy {bundle}"


def test_a_bundle_that_does_not_say_where_it_was_trained_needs_an_environment(hprs, here):
    from hprs.deploy import save_bundle
    from tests.deploy.small import small

    save_bundle(small(), here / "old.bundle")
    code, out, err = hprs("evaluate", "old.bundle")
    assert (code, out) == (2, "")
    assert err == (
        "hprs: 'old.bundle' does not say where it was trained; name the environment, as in "
        "hprs evaluate ENV --policy old.bundle\n"
    )


def test_a_task_that_asks_too_little_is_named(hprs, here):
    (here / "easy.hprs").write_text(
        "signal x = obs[0] in [-4.8, 4.8]\nensure near: abs(x) <= 4\nconquer middle: abs(x) <= 3\n"
    )
    easy = ("evaluate", "CartPole-v1", "--task", "easy.hprs", "--policy", "zero", "--episodes", "3")
    code, out, _ = hprs(*easy)
    assert code == 0
    assert "The task asks too little: 'middle', the target, holds at every reset" in out
    assert "The task asks too little: random meets the task in 100% of its episodes." in out
