"""Constrained learning: safety as a cost with a limit beside the reward (PPO with a Lagrangian).

    python examples/with_a_safety_cost.py --steps 20000 --limit 5

Needs `pip install 'hprs[classic,sb3]'`. Every step's `info["cost"]` is the number of safety
requirements it violates. Libraries such as OmniSafe and Safety-Gymnasium want the cost beside the
reward: return `(observation, reward, info["cost"], terminated, truncated, info)` there.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium as gym
from stable_baselines3 import PPO

import hprs


class Lagrangian(gym.Wrapper[Any, Any, Any, Any]):
    """Subtracts multiplier * cost; the multiplier grows while episodes cost more than the limit.

    Args:
        env: An environment wrapped by hprs.
        limit: The cost that an episode may have.
        rate: How fast the multiplier moves.
    """

    def __init__(self, env: gym.Env[Any, Any], limit: float, *, rate: float = 0.01) -> None:
        super().__init__(env)
        self.limit, self.rate, self.multiplier = limit, rate, 1.0
        self.costs: list[float] = []
        """Of the episodes that have ended: one that was broken off says nothing of the limit."""
        self._cost = 0.0

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; its cost is counted anew."""
        self._cost = 0.0
        return self.env.reset(**options)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """A step, and the multiplier's at the end of an episode."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._cost += info["cost"]
        penalised = float(reward) - self.multiplier * info["cost"]
        if terminated or truncated:
            self.costs.append(self._cost)
            self.multiplier += self.rate * (self._cost - self.limit)
            self.multiplier = max(self.multiplier, 0.0)
        return observation, penalised, terminated, truncated, info


def main() -> None:
    """Train under the limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2_000)
    parser.add_argument("--limit", type=float, default=5.0, help="cost of an episode")
    options = parser.parse_args()

    task = hprs.load_task(Path(__file__).with_name("pendulum.hprs"))
    # A violation costs; it does not end the episode.
    wrapped = hprs.wrap(gym.make("Pendulum-v1"), task, end_on_violation=False)
    env = Lagrangian(wrapped, options.limit)
    PPO("MlpPolicy", env, n_steps=256, batch_size=64, seed=0, device="cpu").learn(options.steps)
    first, last = env.costs[0], env.costs[-1]
    print(
        f"Cost of the first of {len(env.costs)} episodes {first:.0f}, of the last one {last:.0f}."
    )
    print(f"Limit {options.limit:g}, multiplier {env.multiplier:.3f}.")


if __name__ == "__main__":
    main()
