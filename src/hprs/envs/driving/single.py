"""One car as a `gymnasium.Env`: one compiled call a step, with one array in and one array out."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from jax import Array

from hprs.carsim.packed import as_one_kernel
from hprs.carsim.race import CONTROL_STEP
from hprs.envs.driving.description import action_details, observation_details
from hprs.envs.driving.layout import episode_layout
from hprs.envs.driving.rendering import RENDER_MODES, make_drawing
from hprs.envs.driving.simulation import Episode, Signals, Simulation
from hprs.envs.simulated import draw_key
from hprs.errors import UsageError

METADATA: dict[str, Any] = {"render_modes": [], "render_fps": round(1 / CONTROL_STEP)}
"""Gymnasium's, of the driving environments."""


class DrivingEnv(gym.Env[np.ndarray, np.ndarray]):
    """A driving benchmark.

    The observation is `hprs.envs.driving.simulation.observe`; `info["signals"]` holds the signals.
    Episodes are cut off by Gymnasium's `TimeLimit`, which `gymnasium.make` puts on.

    Args:
        simulation: What is driven.
        render_mode: `rgb_array`, for pictures from above, or None.
        camera: Of the pictures: `fixed`, the whole track, or `follow`, around the car.
    """

    metadata: ClassVar[dict[str, Any]] = {**METADATA, "render_modes": list(RENDER_MODES)}

    def __init__(
        self, simulation: Simulation, render_mode: str | None = None, camera: str = "fixed"
    ) -> None:
        self._drawing = make_drawing(simulation, render_mode, camera)
        self.render_mode = render_mode
        self.simulation = simulation
        self.observation_space = observation_space(simulation)
        self.action_space = action_space()
        self._names = simulation.signal_names
        self._at = episode_layout(simulation).size
        self._tail = self._at + simulation.observation_size
        self._packed: Array | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode; all that it draws comes from two words of `np_random`."""
        super().reset(seed=seed)
        if self._drawing is not None:
            self._drawing.restart()
        observation, tail = self._read(_reset(self.simulation, draw_key(self.np_random)))
        return observation, {"signals": dict(zip(self._names, tail[:-2], strict=True))}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Drive for 0.1 s."""
        if self._packed is None:
            raise UsageError("step() was called before reset().")
        action = np.asarray(action, np.float32)
        if action.shape != (2,) or not all(map(math.isfinite, action.tolist())):
            raise UsageError(
                f"An action is a change of speed and a steering, two finite numbers, not {action}."
            )
        observation, tail = self._read(_step(self.simulation, self._packed, action))
        signals = dict(zip(self._names, tail[:-2], strict=True))
        return observation, tail[-2], tail[-1] != 0, False, {"signals": signals}

    @property
    def observation_details(self) -> dict[str, Any]:
        """What an observation is made of, as JSON; policy bundles hold it."""
        return observation_details(self.simulation)

    @property
    def action_details(self) -> dict[str, Any]:
        """What an action changes, as JSON; policy bundles hold it."""
        return action_details()

    @property
    def episode(self) -> Episode:
        """The state of the running episode, as NumPy arrays: for drivers that know everything."""
        if self._packed is None:
            raise UsageError("There is no episode before reset().")
        layout = episode_layout(self.simulation)
        return layout.read(np.asarray(self._packed)[: layout.size])

    def render(self) -> np.ndarray:
        """The picture of the newest state, (480, 720, 3) uint8."""
        if self._drawing is None:
            raise UsageError(
                "Nothing is drawn without a mode: gymnasium.make(..., render_mode='rgb_array')."
            )
        return self._drawing.picture()

    def _read(self, packed: Array) -> tuple[np.ndarray, list[float]]:
        """The observation; the signals, the reward and whether the episode has terminated."""
        self._packed = packed
        words = np.asarray(packed)
        if self._drawing is not None:
            self._drawing.see(words)
        numbers = words.view(np.float32)
        return numbers[self._at : self._tail].copy(), numbers[self._tail :].tolist()


def observation_space(simulation: Simulation) -> spaces.Box:
    """Of one environment."""
    return spaces.Box(-1.0, 1.0, (simulation.observation_size,), np.float32)


def action_space() -> spaces.Box:
    """Of one environment: change of speed, and steering to the left."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


@as_one_kernel
def _reset(simulation: Simulation, key: Array) -> Array:
    episode, observation, signals = simulation.reset(jax.random.wrap_key_data(key))
    zero = jnp.zeros((), observation.dtype)
    return _pack(simulation, episode, observation, signals, zero, zero)


@as_one_kernel
def _step(simulation: Simulation, packed: Array, action: Array) -> Array:
    layout = episode_layout(simulation)
    episode = layout.unpack(packed[: layout.size])
    episode, observation, signals, reward, terminated, _ = simulation.step(episode, action)
    return _pack(simulation, episode, observation, signals, reward, terminated)


def _pack(
    simulation: Simulation,
    episode: Episode,
    observation: Array,
    signals: Signals,
    reward: Array,
    terminated: Array,
) -> Array:
    tail = [signals[name] for name in simulation.signal_names]
    tail += [reward, terminated.astype(observation.dtype)]
    results = jnp.concatenate([observation, jnp.stack(tail)])
    words = jax.lax.bitcast_convert_type(results, jnp.uint32)
    return jnp.concatenate([episode_layout(simulation).pack(episode), words])
