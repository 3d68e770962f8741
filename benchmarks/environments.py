"""What our changes to Gymnasium's lander and walker cost, as ratios of steps with resets.

    .venv/bin/python benchmarks/environments.py

The same random actions for both. The landers play the same episodes, the walkers only the first:
Gymnasium's next one depends on the last.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import time

import gymnasium as gym

import hprs.envs.bipedal_walker.env as walker
import hprs.envs.lunar_lander.env as lander
from hprs.envs.box2d import bipedal_walker, lunar_lander

ROUNDS, STEPS = 10, 5_000


def step_time(env: gym.Env) -> float:
    """Seconds of processor time a step of random actions, resets included."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(1_000)]
    start = time.process_time()
    for step in range(STEPS):
        if env.step(actions[step % 1_000])[2]:
            env.reset()
    return (time.process_time() - start) / STEPS


def compare(name: str, theirs: gym.Env, ours: gym.Env) -> None:
    """Print the smallest of several measurements of each, taken in turns."""
    times = [(step_time(theirs), step_time(ours)) for _ in range(ROUNDS)]
    their_time, our_time = (min(column) for column in zip(*times, strict=True))
    print(
        f"{name}: Gymnasium {their_time * 1e6:.1f} us, ours {our_time * 1e6:.1f} us, "
        f"{our_time / their_time - 1:+.1%}"
    )


compare(
    "lander",
    lunar_lander.LunarLander(continuous=True),
    lander.LunarLanderObstacle(obstacle=(1.5, 1.6), x_offset=0),
)
compare("walker", bipedal_walker.BipedalWalker(), walker.BipedalWalker())
compare(
    "hardcore walker",
    bipedal_walker.BipedalWalker(hardcore=True),
    walker.BipedalWalker(hardcore=True),
)
