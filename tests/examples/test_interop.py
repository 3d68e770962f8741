"""Every example about other libraries runs, on a few hundred steps, and says something."""

from __future__ import annotations

import importlib.util
import os
import re
import runpy
import sys
from pathlib import Path

import gymnasium as gym
import jax
import numpy as np
import pytest
import torch

import hprs
from hprs.rewards import REWARDS
from tests.rewards.episodes import options_of

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Runs an example in an empty folder; gives what it printed."""
    monkeypatch.chdir(tmp_path)

    def example(name, *options):
        path = EXAMPLES / f"{name}.py"
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, options)])
        runpy.run_path(str(path), run_name="__main__")
        return capsys.readouterr().out

    return example


def test_stable_baselines3_learns_from_a_task(run):
    out = run("with_stable_baselines3", "--steps", 300)
    assert re.search(r"After 300 steps: PAM \d\.\d{3} over \d+ steps", out)
    assert "gentle" in out


def test_a_jax_environment_is_paid_in_a_scan(run):
    out = run("with_jax_scan", "--steps", 200)
    # Nothing is unsafe, so that every copy ends twice, at its horizon.
    assert "64 copies of 200 steps" in out and "128 ends" in out
    assert "on_track 1.00" in out


def test_a_jax_trace_is_the_first_episode_of_each_copy_from_its_first_state():
    example = runpy.run_path(str(EXAMPLES / "with_jax_scan.py"))
    # Copy 0 is unsafe after its first end alone, copy 1 in s_0 alone, copy 2 never ends.
    x = np.array([[1.0, 1.0, 1.0, 4.5], [4.5, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, 4.5]]).T
    ended = np.array([[False, True, False], [False, True, False], [False, False, False]]).T
    trace = {"x": x, "v": np.zeros_like(x), "force": np.zeros_like(x)}
    found = example["first_episodes"](ended, trace)
    assert [one.length for one in found] == [2, 2, 3]
    assert [one.safe for one in found] == [True, False, False]


def test_a_jax_scan_keeps_the_first_state():
    example = runpy.run_path(str(EXAMPLES / "with_jax_scan.py"))
    keys = jax.random.split(jax.random.key(0), 6)
    rewards, ended, trace = example["roll_out"](keys)
    assert (len(rewards), len(ended)) == (5, 5)
    assert {len(values) for values in trace.values()} == {6}
    assert trace["x"][0] == example["reset"](keys[0])["x"]
    assert "margins(" not in (EXAMPLES / "with_jax_scan.py").read_text()


def test_a_pytorch_batch_is_paid_without_numpy(run, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("a tensor was made a NumPy array")

    monkeypatch.setattr(torch.Tensor, "__array__", refuse)
    monkeypatch.setattr(torch.Tensor, "numpy", refuse)
    out = run("with_pytorch_batch", "--steps", 200, "--environments", 256)
    assert "51,200 steps on cpu" in out
    assert "weight * dt" in (EXAMPLES / "with_pytorch_batch.py").read_text()


@pytest.mark.parametrize("name", REWARDS)
def test_a_row_of_a_pytorch_batch_is_paid_as_if_it_were_alone(name):
    """Whatever a memory is made of: rows begin their episodes at different times."""
    example = runpy.run_path(str(EXAMPLES / "with_pytorch_batch.py"))
    # As many rows as requirements: a mask of rows would also fit the columns of a memory.
    task, count = example["TASK"], 4
    reward = hprs.make_reward(name, task, **options_of(name, task))
    torch.manual_seed(0)
    states = torch.rand(12, len(task.signals) + 1, count, dtype=torch.float64) * 2 - 1
    names = [*(signal.name for signal in task.signals), "env_reward"]
    ends = torch.arange(12)[:, None] % torch.tensor([2, 3, 5, 20]) == 1

    def paid(rows):
        term, nothing = example["RewardTerm"](reward), torch.zeros(len(rows), dtype=torch.bool)
        term.begin(dict(zip(names, states[0][:, rows], strict=True)), rows=None)
        for state, ended in zip(states[1:], ends[1:], strict=True):
            signals = dict(zip(names, state[:, rows], strict=True))
            yield term(signals, ended[rows], nothing)
            if ended[rows].any():
                fresh = {name: -value for name, value in signals.items()}
                term.begin(fresh, rows=ended[rows])

    together = torch.stack(list(paid([0, 1, 2, 3])))
    for row in range(count):
        assert torch.equal(torch.stack(list(paid([row])))[:, 0], together[:, row])


def test_rewards_have_the_interface_of_mo_gymnasium(run):
    out = run("with_mo_gymnasium", "--steps", 300)
    assert "reward space Box(-inf, inf, (4,), float64): slow, up, calm, gentle" in out
    assert out.count("a step") == 4


def test_safety_is_a_cost_with_a_limit(run):
    out = run("with_a_safety_cost", "--steps", 300, "--limit", 1)
    # PPO collects 2 * 256 steps: two whole episodes of 200, and one that it breaks off.
    costs = re.search(r"Cost of the first of 2 episodes (\d+), of the last one (\d+)\.", out)
    multiplier = 1.0
    for cost in costs.groups():
        multiplier = max(0.0, multiplier + 0.01 * (int(cost) - 1))
    assert f"Limit 1, multiplier {multiplier:.3f}." in out


class Scripted(gym.Env):
    """An environment that pays 1 a step, with costs and ends as a list says."""

    def __init__(self, steps):
        self.steps = iter(steps)

    def reset(self, *, seed=None, options=None):
        return 0, {}

    def step(self, action):
        cost, terminated, truncated = next(self.steps)
        return 0, 1.0, terminated, truncated, {"cost": cost}


def test_the_multiplier_of_a_safety_cost_moves_as_by_hand():
    on, dead, late = (False, False), (True, False), (False, True)
    script = [(2, *on), (1, *dead), (0, *on), (0, *late), (3, *on), (0, *on), (2, *dead)]
    example = runpy.run_path(str(EXAMPLES / "with_a_safety_cost.py"))
    env = example["Lagrangian"](Scripted(script), limit=1.0, rate=0.5)
    found = []
    for number in range(len(script)):
        # The third episode is broken off after two steps: its cost of 3 moves nothing.
        if number in (0, 2, 4, 6):
            env.reset()
        found.append((env.step(0)[1], env.multiplier, list(env.costs)))
    assert found == [
        (1 - 1 * 2, 1.0, []),
        # 1 + 0.5 * (3 - 1) = 2; the penalty of this step is by the multiplier before it.
        (1 - 1 * 1, 2.0, [3.0]),
        (1.0, 2.0, [3.0]),
        # An episode without a cost counts: 2 + 0.5 * (0 - 1) = 1.5.
        (1.0, 1.5, [3.0, 0.0]),
        (1 - 1.5 * 3, 1.5, [3.0, 0.0]),
        (1.0, 1.5, [3.0, 0.0]),
        # 1.5 + 0.5 * (2 - 1) = 2.
        (1 - 1.5 * 2, 2.0, [3.0, 0.0, 2.0]),
    ]


def test_the_multiplier_of_a_safety_cost_is_never_negative():
    example = runpy.run_path(str(EXAMPLES / "with_a_safety_cost.py"))
    env = example["Lagrangian"](Scripted([(0, True, False)]), limit=5.0, rate=1.0)
    env.reset()
    env.step(0)
    # 1 + 1 * (0 - 5) = -4.
    assert env.multiplier == 0.0


def test_a_recorded_log_is_assessed_in_every_form(run):
    out = run("recorded_log", "--steps", 200, "--out", "logs")
    found = re.findall(r"(logs/\S+): (\d+) steps, PAM (\S+)", out)
    example = runpy.run_path(str(EXAMPLES / "recorded_log.py"))
    rows = example["record"](200)

    def pam(first):
        trace = {name: [row[name] for row in rows[first:]] for name in rows[0] if name != "time"}
        return f"{hprs.assess(hprs.load_task(example['TASK']), trace).pam:.3f}"

    assert found == [
        ("logs/log.csv", "200", pam(0)),
        ("logs/log.parquet", "200", pam(0)),
        # A bag's first tick has no action before it.
        ("logs/bag", "199", pam(1)),
        ("logs/no_spin.csv", "200", "unknown"),
    ]
    # So that the bag cannot be right by chance.
    assert pam(0) != pam(1)
    assert "The log does not say whether slow, calm is met." in out


def test_the_cheetah_has_a_task_file(run):
    if importlib.util.find_spec("mujoco") is None:
        reason = "needs MuJoCo: pip install 'hprs[mujoco]'"
        if "mujoco" in os.environ.get("HPRS_TEST_NEEDS", "").split():
            pytest.fail(reason)
        pytest.skip(reason)
    out = run("half_cheetah", "--steps", 256)
    assert re.search(r"nothing: PAM 1\.125 over 1000 steps \(upright 1\.00, far 0\.00", out)
    assert "PPO, 256 steps: PAM" in out


@pytest.mark.parametrize("task", sorted(EXAMPLES.glob("*.hprs")), ids=lambda path: path.name)
def test_a_task_file_has_nothing_to_remark(task):
    assert not hprs.load_task(task).analysis.remarks
