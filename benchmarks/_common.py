"""What the speed measurements share: the yardstick, and how to time."""

from __future__ import annotations

import time
from collections.abc import Callable

import gymnasium as gym

import hprs

LANDER = """
signal x     = obs[0] in [-2.5, 2.5]
signal y     = obs[1] in [-2.5, 2.5]
signal angle = obs[4] in [-6.2832, 6.2832] "rad"
signal spin  = obs[5] in [-10, 10]
let    off_pad = hypot(max(abs(x) - 0.15, 0), y)

ensure    in_field: abs(x) <= 1
ensure    above:    y >= -0.5
conquer   on_pad:   off_pad <= 0.01
encourage upright:  abs(angle) <= 60 deg
encourage calm:     abs(spin) <= 0.5
"""
"""Five requirements on Gymnasium's lander."""

DRIVING = """
signal progress = info.progress in [0, 1]
signal wall     = info.wall     in [0, 1]
signal hit      = info.hit      in [0, 1]
signal v        = obs[0]        in [0, 5] "m/s"
signal steering = action[0]     in [-1, 1]
signal jerk     = info.jerk     in [0, 2.83]

ensure    no_crash: hit <= 0.5
achieve   lap:      progress >= 1
encourage center:   wall >= 0.5
encourage fast:     v >= 2
encourage slow:     v <= 3.5
encourage straight: abs(steering) <= 0.1
encourage smooth:   jerk <= 0.25
"""
"""The paper's seven driving requirements."""


def lander() -> gym.Env:
    """The yardstick's environment: Gymnasium's continuous lander."""
    return gym.make("LunarLander-v3", continuous=True, disable_env_checker=True)


def lander_step(env: gym.Env, steps: int = 10_000) -> float:
    """Seconds a step of a lander that flies random actions, resets included."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(1_000)]
    start = time.perf_counter()
    for step in range(steps):
        _, _, terminated, truncated, _ = env.step(actions[step % 1_000])
        if terminated or truncated:
            env.reset()
    return (time.perf_counter() - start) / steps


def best_of(function: Callable[[], float], repeats: int = 5) -> float:
    """The smallest of several measurements: the one least disturbed by other work."""
    return min(function() for _ in range(repeats))


def seconds(function: Callable[[], object], repeats: int = 20) -> float:
    """The smallest time of one call, after a first one."""
    function()

    def once() -> float:
        start = time.perf_counter()
        function()
        return time.perf_counter() - start

    return best_of(once, repeats)


def lander_task() -> hprs.Task:
    """The lander's task."""
    return hprs.parse_task(LANDER)


def driving_task() -> hprs.Task:
    """The driving task."""
    return hprs.parse_task(DRIVING)
