"""An environment of your own as JAX functions: a planar drone that flies round a pillar to a pad.

    cd examples
    hprs train own_jax_environment:Drone-v0 --task drone.hprs

All of it that `hprs` needs stands here; docs/own_environment.md explains it. The task is in
examples/drone.hprs. `python own_jax_environment.py` flies one episode with random thrusts.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from jax import Array

import hprs
from hprs.envs.simulated import SimulatedEnv

STEP = 0.05
"""s."""


class State(NamedTuple):
    """Where the drone is, in metres and radians, and how it moves, a second."""

    x: Array
    z: Array
    angle: Array
    vx: Array
    vz: Array
    spin: Array


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Drone:
    """Two rotors at the ends of a rod. Thrusts are between -1 and 1; with 0 the drone hovers.

    Parameters are arrays: other values run in the same compiled program.
    """

    gravity: Array
    arm: Array
    """Half of the rod, m."""
    inertia: Array
    """Of a mass of 1 kg, m^2."""

    def reset(self, key: Array) -> tuple[State, Array, dict[str, Array]]:
        """The drone hangs in the air on the left."""
        x, z, angle = jax.random.uniform(
            key, (3,), minval=jnp.array([-2.2, 0.7, -0.2]), maxval=jnp.array([-1.5, 1.5, 0.2])
        )
        still = jnp.zeros(())
        state = State(x, z, angle, still, still, still)
        return state, jnp.stack(state), signals(state)

    def step(
        self, state: State, action: Array
    ) -> tuple[State, Array, dict[str, Array], Array, Array, Array]:
        """Euler's method. No reward of its own, and no end: those are the task's."""
        left, right = 0.5 * self.gravity * (1 + action)
        thrust, torque = left + right, self.arm * (right - left)
        vx = state.vx - STEP * thrust * jnp.sin(state.angle)
        vz = state.vz + STEP * (thrust * jnp.cos(state.angle) - self.gravity)
        spin = state.spin + STEP * torque / self.inertia
        state = State(
            x=state.x + STEP * vx,
            z=state.z + STEP * vz,
            angle=state.angle + STEP * spin,
            vx=vx,
            vz=vz,
            spin=spin,
        )
        no = jnp.zeros((), bool)
        return state, jnp.stack(state), signals(state), jnp.zeros(()), no, no


def signals(state: State) -> dict[str, Array]:
    """What the task reads by name; it takes the rest from observation and action."""
    return {name: getattr(state, name) for name in ("x", "z", "vx", "vz", "angle")}


def make_drone(gravity: float = 9.81) -> SimulatedEnv:
    """The environment; its options are those of `gymnasium.make` and of `--env NAME=VALUE`."""
    return SimulatedEnv(
        Drone(jnp.asarray(gravity), arm=jnp.asarray(0.2), inertia=jnp.asarray(0.1)),
        observation_space=spaces.Box(-np.inf, np.inf, (6,), np.float32),
        action_space=spaces.Box(-1.0, 1.0, (2,), np.float32),
    )


gym.register("Drone-v0", make_drone, max_episode_steps=200)


def main() -> None:
    """Fly one episode with random thrusts."""
    env = hprs.wrap(gym.make("Drone-v0"), hprs.load_task(Path(__file__).with_name("drone.hprs")))
    env.action_space.seed(0)
    env.reset(seed=0)
    ended = False
    while not ended:
        *_, terminated, truncated, info = env.step(env.action_space.sample())
        ended = terminated or truncated
    print(info["assessment"])


if __name__ == "__main__":
    main()
