"""Gymnasium's HalfCheetah with a task file: run forward, stay upright, be gentle.

    python examples/half_cheetah.py --steps 1000000

Needs `pip install 'hprs[mujoco,sb3]'`. The task is examples/half_cheetah.hprs. For a run directory:
`hprs train HalfCheetah-v5 --task examples/half_cheetah.hprs`.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium as gym
from stable_baselines3 import PPO

import hprs


def assessed(env: gym.Env[Any, Any], act: Any, *, seed: int) -> Any:
    """The assessment of one episode."""
    observation, info = env.reset(seed=seed)
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = env.step(act(observation))
        ended = terminated or truncated
    return info["assessment"]


def main() -> None:
    """Train, and compare the policy with doing nothing and with random actions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=4_000)
    steps = parser.parse_args().steps

    task = hprs.load_task(Path(__file__).with_name("half_cheetah.hprs"))
    env = hprs.wrap(gym.make("HalfCheetah-v5"), task)
    env.action_space.seed(0)
    model = PPO("MlpPolicy", env, n_steps=256, batch_size=64, seed=0, device="cpu")
    model.learn(steps)
    policies = {
        "nothing": lambda observation: env.action_space.low * 0,
        "random": lambda observation: env.action_space.sample(),
        f"PPO, {steps:,} steps": lambda observation: model.predict(observation, deterministic=True)[
            0
        ],
    }
    for name, act in policies.items():
        found = assessed(env, act, seed=1)
        rows = ", ".join(f"{label} {float(met):.2f}" for label, met in found.requirements.items())
        print(f"{name:>20}: PAM {found.pam:.3f} over {found.length} steps ({rows})")


if __name__ == "__main__":
    main()
