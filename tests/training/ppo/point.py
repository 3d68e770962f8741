"""A mass on a line as JAX functions, and as a Gymnasium environment: what a program compiles fast."""

from dataclasses import dataclass

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces

from hprs.envs.simulated import SimulatedEnv

ID = "tests.training.ppo.point:Point-v0"
TASK = """
signal x     in [-2, 2] "m"
signal v     = obs[1] in [-2, 2] "m/s"
signal force = action[0] in [-1, 1] "N"
signal last  = last_action[0] in [-1, 1] "N"

ensure    inside: abs(x) <= 1.5
achieve   there:  abs(x - 1) <= 0.1
encourage gentle: abs(force) <= 0.5
encourage smooth: abs(force - last) <= 0.2
"""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Point:
    """Pushed by a force for steps of 0.1 s."""

    mass: jax.Array

    def reset(self, key):
        x = jax.random.uniform(key, minval=-1.0, maxval=0.5)
        state = (x, jnp.zeros(()))
        return state, jnp.stack(state), {"x": x}

    def step(self, state, action):
        x, v = state
        v = v + 0.1 * action[0] / self.mass
        x = x + 0.1 * v
        no = jnp.zeros((), bool)
        return (x, v), jnp.stack([x, v]), {"x": x}, -jnp.abs(x - 1), no, no


def make_point():
    return SimulatedEnv(
        Point(jnp.asarray(1.0)),
        spaces.Box(-np.inf, np.inf, (2,), np.float32),
        spaces.Box(-1.0, 1.0, (1,), np.float32),
    )


gym.register("Point-v0", make_point, max_episode_steps=40)
