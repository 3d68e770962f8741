"""Rewards of a PyTorch batch, as Isaac Lab users have it: tensors in, rewards out, on their device.

    python examples/with_pytorch_batch.py --steps 200 --device cuda

Needs PyTorch alone beside hprs. Nothing passes through NumPy. The class below is what goes into a
manager-based environment as one reward term. Mind the scale: Isaac Lab's reward manager multiplies
every term by weight * dt, dt being the environment's step in seconds. Give the term the weight
1 / dt; with any other, 1.0 included, the learner sees another reward than `hprs` computes.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import torch
from torch.utils._pytree import tree_map

import hprs
from hprs.rewards import Reward, safety_cost

TASK = hprs.load_task(Path(__file__).with_name("park.hprs"))
DT, HORIZON = 0.1, 100


def merged(rows: Any, new: Any, old: Any) -> Any:
    """A memory with some rows from another. The batch is the first axis of all its tensors."""

    def choose(new: Any, old: Any) -> Any:
        return torch.where(rows.reshape(-1, *[1] * (new.ndim - 1)), new, old)

    return tree_map(choose, new, old)


class RewardTerm:
    """A reward over a batch of environments; it holds the memories that the reward has none of.

    Args:
        reward: The reward.
    """

    def __init__(self, reward: Reward) -> None:
        self.reward, self.memory = reward, None

    def begin(self, signals: dict[str, Any], rows: Any) -> None:
        """Begin episodes in some rows, from the signals of the states after the reset."""
        fresh = self.reward.init(signals)
        if self.memory is None:
            self.memory = fresh
        else:
            self.memory = merged(rows, fresh, self.memory)

    def __call__(self, signals: dict[str, Any], terminated: Any, truncated: Any) -> Any:
        """The rewards of the transitions into these states, before any of them is reset."""
        self.memory, rewards = self.reward.step(self.memory, signals, terminated, truncated)
        return rewards


def main() -> None:
    """Push a batch of masses, and pay them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--environments", type=int, default=4_096)
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()

    torch.manual_seed(0)
    device, count = options.device, options.environments
    zeros = torch.zeros(count, device=device)
    state = {"x": torch.empty_like(zeros).uniform_(-4, 4), "v": zeros, "force": zeros}
    term, weight = RewardTerm(hprs.make_reward("hprs", TASK)), 1 / DT
    cost = safety_cost(TASK)
    age = zeros.clone()
    term.begin(state, rows=None)
    total, violations = torch.zeros((), device=device), torch.zeros((), device=device)
    for _ in range(options.steps):
        force = (0.5 * (1 - state["x"]) - state["v"]).clip(-1, 1)
        v = state["v"] + force * DT
        state, age = {"x": state["x"] + v * DT, "v": v, "force": force}, age + 1
        _, costs = cost.step(None, state, False, False)
        terminated, truncated = costs > 0, age >= HORIZON
        rewards = term(state, terminated, truncated)
        # This is what the reward manager does with a term.
        total += (rewards * weight * DT).sum()
        violations += costs.sum()
        ended = terminated | truncated
        new = {"x": torch.empty_like(zeros).uniform_(-4, 4), "v": zeros, "force": zeros}
        state = {name: torch.where(ended, new[name], state[name]) for name in state}
        age = torch.where(ended, zeros, age)
        term.begin(state, rows=ended)
    steps = options.steps * count
    print(f"{steps:,} steps on {total.device}: {total.item() / steps:.4f} a step.")
    print(f"Violations of safety: {violations.item():.0f}.")


if __name__ == "__main__":
    main()
