"""One reward a requirement, in the interface of MO-Gymnasium, for multi-objective learners.

    python examples/with_mo_gymnasium.py --steps 300

Needs `pip install 'hprs[classic]'`. MO-Gymnasium itself is not needed: its interface is that of
Gymnasium, with a vector for the reward and a `reward_space`. (The package asks for pygame, which
overwrites the pygame-ce of Gymnasium's own extras: install it in an environment of its own.)
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import hprs


def check_multi_objective(env: gym.Env[Any, Any], *, seed: int = 0) -> None:
    """What MO-Gymnasium's learners and wrappers rely on.

    Raises:
        AssertionError: The environment does not have it.
    """
    space = env.unwrapped.reward_space
    assert isinstance(space, gym.spaces.Box) and len(space.shape) == 1
    assert env.get_wrapper_attr("reward_space") == space
    assert env.unwrapped.reward_dim == space.shape[0]
    observation, info = env.reset(seed=seed)
    assert observation in env.observation_space and isinstance(info, dict)
    env.action_space.seed(seed)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    assert observation in env.observation_space and isinstance(info, dict)
    assert isinstance(reward, np.ndarray) and reward in space
    assert isinstance(terminated, bool) and isinstance(truncated, bool)


def main() -> None:
    """Check the interface, and compare two weightings of the same vector rewards."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=300)
    steps = parser.parse_args().steps

    task = hprs.load_task(Path(__file__).with_name("pendulum.hprs"))
    env = hprs.wrap(
        gym.make("Pendulum-v1"), task, reward="vector", reward_options={"form": "score"}
    )
    check_multi_objective(env)
    print(f"reward space {env.unwrapped.reward_space}: {', '.join(task.labels)}")

    env.reset(seed=0)
    total = np.zeros(len(task.requirements))
    for _ in range(steps):
        _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        total += reward
        if terminated or truncated:
            env.reset()
    for label, mean in zip(task.labels, total / steps, strict=True):
        print(f"{label:>8} {mean:.3f} a step")
    for weights in ([0.4, 0.4, 0.1, 0.1], [0.1, 0.1, 0.4, 0.4]):
        print(f"weighted by {weights}: {np.dot(weights, total / steps):.3f}")


if __name__ == "__main__":
    main()
