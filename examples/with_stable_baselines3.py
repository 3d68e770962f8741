"""Any Stable-Baselines3 algorithm learns from a task: wrap the environment, nothing else.

    python examples/with_stable_baselines3.py --steps 20000

Needs `pip install 'hprs[classic,sb3]'`. The same with a run directory, evaluations and resuming:
`hprs train Pendulum-v1 --task examples/pendulum.hprs --trainer sb3`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import gymnasium as gym
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor

import hprs


def main() -> None:
    """Train, then assess one episode of the policy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2_000)
    steps = parser.parse_args().steps

    task = hprs.load_task(Path(__file__).with_name("pendulum.hprs"))
    env = Monitor(hprs.wrap(gym.make("Pendulum-v1"), task, reward="hprs"))
    model = PPO("MlpPolicy", env, n_steps=256, batch_size=64, seed=0, device="cpu")
    model.learn(steps)

    observation, info = env.reset(seed=1)
    ended = False
    while not ended:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    found = info["assessment"]
    print(f"After {steps:,} steps: PAM {found.pam:.3f} over {found.length} steps.")
    for label, value in found.requirements.items():
        print(f"{label:>8} {value}")


if __name__ == "__main__":
    main()
