"""Environments that are written as JAX functions, as `gymnasium.Env`: docs/own_environment.md."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import gymnasium as gym
import jax
import numpy as np
from gymnasium import spaces
from jax import Array

from hprs.errors import UsageError

__all__ = ["SimulatedEnv", "Simulation", "draw_key"]


@runtime_checkable
class Simulation(Protocol):
    """One episode as pure functions; a tree of arrays, given to compiled functions as argument.

    Nothing resets by itself, and time limits are Gymnasium's.
    """

    def reset(self, key: Array) -> tuple[Any, Array, dict[str, Array]]:
        """State, observation (n,) and signals of a new episode; all that it draws is of `key`."""
        ...

    def step(self, state: Any, action: Array) -> tuple[Any, Array, dict[str, Array], Any, Any, Any]:
        """State, observation, signals, the environment's own reward, terminated, truncated."""
        ...


class SimulatedEnv(gym.Env[np.ndarray, Any]):
    """A simulation, one step at a time.

    `hprs train` never steps it: it compiles the simulation's functions with the training. All else
    does, and sees the same episodes: `hprs evaluate`, other libraries, your own loops.

    Args:
        simulation: The functions. A dataclass with arrays as fields, registered with
            `jax.tree_util.register_dataclass`, makes different parameters share a compilation.
        observation_space: A row of numbers.
        action_space: A `Discrete`, or a `Box` of one axis.

    Raises:
        UsageError: JAX does not know the simulation as a tree.
    """

    def __init__(
        self,
        simulation: Simulation,
        observation_space: spaces.Box,
        action_space: spaces.Box | spaces.Discrete,
    ) -> None:
        if jax.tree_util.all_leaves([simulation]):
            raise UsageError(
                f"JAX does not know {type(simulation).__name__} as a tree of arrays. "
                "Make it a frozen dataclass under jax.tree_util.register_dataclass."
            )
        self.simulation = simulation
        self.observation_space = observation_space
        self.action_space = action_space
        self._state: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode; all that it draws comes from two words of `np_random`."""
        super().reset(seed=seed)
        self._state, observation, signals = _reset(self.simulation, draw_key(self.np_random))
        return self._seen(observation), _info(signals)

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One step."""
        if self._state is None:
            raise UsageError("step() was called before reset().")
        self._state, observation, signals, reward, terminated, truncated = _step(
            self.simulation, self._state, np.asarray(action, self.action_space.dtype)
        )
        ended = bool(terminated), bool(truncated)
        return self._seen(observation), float(reward), *ended, _info(signals)

    def _seen(self, observation: Array) -> np.ndarray:
        # A copy: what JAX holds cannot be written to.
        return np.array(observation, self.observation_space.dtype)


def draw_key(generator: np.random.Generator) -> np.ndarray:
    """Data of the JAX key of a new episode, (2,) uint32."""
    return generator.integers(0, 2**32, 2, np.uint32)


def _info(signals: dict[str, Array]) -> dict[str, Any]:
    found = jax.device_get(signals)
    return {
        "signals": {
            name: value.item() if value.ndim == 0 else value for name, value in found.items()
        }
    }


@jax.jit
def _reset(simulation: Simulation, key: Array) -> tuple[Any, Array, dict[str, Array]]:
    return simulation.reset(jax.random.wrap_key_data(key))


@jax.jit
def _step(
    simulation: Simulation, state: Any, action: Array
) -> tuple[Any, Array, dict[str, Array], Any, Any, Any]:
    return simulation.step(state, action)
