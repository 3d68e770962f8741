"""Many cars as a `gymnasium.vector.VectorEnv`: one compiled call steps all of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from jax import Array
from numpy.typing import NDArray

from hprs.envs.driving.options import Options, refuse_horizon, simulate
from hprs.envs.driving.simulation import Episode, Signals, Simulation
from hprs.envs.driving.single import METADATA, action_space, observation_space
from hprs.envs.options import count
from hprs.envs.simulated import draw_key
from hprs.errors import UsageError

Mask = NDArray[np.bool_]

RESET_AT_ONCE = 32
"""Rows that one compiled call resets; fewer are filled up, more take several calls."""


class DrivingVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """A driving benchmark, many times; every row is what the single environment would be.

    Row i of `reset(seed=s)` is seeded with s + i and has a generator of its own, as in Gymnasium's
    `SyncVectorEnv`. All three autoreset modes are there; `reset` takes `options["reset_mask"]`.

    Args:
        num_envs: How many cars learn.
        max_episode_steps: Control steps after which an episode is truncated; None: as registered.
        autoreset_mode: When a row that has ended is reset.
        **options: Those of the single environment.

    Raises:
        UsageError: There is no such option, or it has no such value.
        TrackError: A map file cannot be read or driven.
    """

    defaults: ClassVar[Options]
    """Of the benchmark."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **options: Any,
    ) -> None:
        super().__init__()
        refuse_horizon(options)
        if max_episode_steps is not None:
            # Here, so that an error names what the caller wrote.
            options["horizon"] = count("max_episode_steps", max_episode_steps)
        simulation = simulate(self.defaults, **options)
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise UsageError(f"num_envs is a whole number from 1 on, not {num_envs!r}.")
        self.num_envs = num_envs
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = {**METADATA, "autoreset_mode": self.autoreset_mode, "reset_mask": True}
        self.simulation = simulation
        self.single_observation_space = observation_space(simulation)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._names = simulation.signal_names
        self._everyone: Mask = np.ones(num_envs, bool)
        self._ended: Mask = ~self._everyone
        self._episodes: Episode | None = None
        # Named as Gymnasium's vector environments in JAX name theirs, for who saves generators.
        self.rng: list[np.random.Generator] = []

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start episodes in all rows, or in those of `options["reset_mask"]`.

        Returns:
            The observations of all rows. In infos the signals of rows that were not reset are
            masked out.
        """
        mask = self._mask(options)
        self._seed(seed)
        if self._episodes is None:
            if not mask.all():
                raise UsageError("The first reset must be of all rows.")
            self._episodes = _nothing(self.simulation, self.num_envs)
            size = self.simulation.observation_size
            self._observations = np.zeros((self.num_envs, size), np.float32)
            self._signals = np.zeros((len(self._names), self.num_envs), np.float32)
        self._restart(mask)
        self._ended = self._ended & ~mask
        return self._observations.copy(), self._infos(self._signals, mask)

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Drive for 0.1 s in every row."""
        actions = self._checked(actions)
        resetting = self._ended
        if self.autoreset_mode == AutoresetMode.DISABLED and resetting.any():
            row = int(np.flatnonzero(resetting)[0])
            raise UsageError(f"The episode of row {row} has ended; reset it with a reset_mask.")
        self._episodes, results = _step_all(self.simulation, self._episodes, actions)
        numbers, flags = np.asarray(results[0]), np.asarray(results[1])
        size = self.simulation.observation_size
        # Copies: JAX's own arrays cannot be written to.
        self._observations = numbers[:, :size].copy()
        self._signals = numbers[:, size:-1].T.copy()
        rewards = numbers[:, -1].astype(np.float64)
        terminated, truncated = flags[0].copy(), flags[1].copy()
        if resetting.any():
            self._restart(resetting)
            rewards[resetting] = 0.0
            terminated &= ~resetting
            truncated &= ~resetting
        self._ended = terminated | truncated
        infos = self._infos(self._signals, self._everyone)
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            infos = self._finish(self._ended)
            self._ended = ~self._everyone
        return self._observations.copy(), rewards, terminated, truncated, infos

    def _finish(self, ended: Mask) -> dict[str, Any]:
        """Restart the rows that have ended; infos with what they ended with."""
        final_obs = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(ended):
            final_obs[row] = self._observations[row].copy()
        final_info = self._infos(self._signals.copy(), ended)
        self._restart(ended)
        return {
            **self._infos(self._signals, self._everyone),
            "final_obs": final_obs,
            "_final_obs": ended.copy(),
            "final_info": final_info,
            "_final_info": ended.copy(),
        }

    def _restart(self, mask: Mask) -> None:
        """New episodes in the rows of a mask."""
        rows = np.flatnonzero(mask)
        at_once = min(RESET_AT_ONCE, self.num_envs)
        for first in range(0, len(rows), at_once):
            some = rows[first : first + at_once]
            keys = np.zeros((at_once, 2), np.uint32)
            keys[: len(some)] = [draw_key(self.rng[row]) for row in some]
            # A row beyond the last one is written nowhere.
            places = np.full(at_once, self.num_envs, np.int32)
            places[: len(some)] = some
            self._episodes, results = _reset_some(self.simulation, self._episodes, places, keys)
            numbers = np.asarray(results)[: len(some)]
            size = self.simulation.observation_size
            self._observations[some] = numbers[:, :size]
            self._signals[:, some] = numbers[:, size:].T

    def _infos(self, signals: np.ndarray, mask: Mask) -> dict[str, Any]:
        """Gymnasium's masked infos."""
        values: dict[str, Any] = dict(zip(self._names, signals.copy(), strict=True))
        values |= {f"_{name}": mask.copy() for name in self._names}
        return {"signals": values, "_signals": mask.copy()}

    def _checked(self, actions: Any) -> np.ndarray:
        if self._episodes is None:
            raise UsageError("step() was called before reset().")
        actions = np.asarray(actions, np.float32)
        if actions.shape != (self.num_envs, 2):
            raise UsageError(
                f"Actions have shape {(self.num_envs, 2)}, a change of speed and a steering in "
                f"each row, not {actions.shape}."
            )
        finite = np.isfinite(actions).all(axis=1)
        if not finite.all():
            row = int(np.flatnonzero(~finite)[0])
            raise UsageError(f"The action of row {row} is not finite: {actions[row]}.")
        return actions

    def _mask(self, options: dict[str, Any] | None) -> Mask:
        if options is None or "reset_mask" not in options:
            return self._everyone
        mask = np.asarray(options["reset_mask"])
        if mask.dtype != np.bool_ or mask.shape != (self.num_envs,) or not mask.any():
            raise UsageError(
                f"reset_mask is {self.num_envs} bools with at least one True, "
                f"not {options['reset_mask']!r:.80}."
            )
        return mask

    def _seed(self, seed: int | Sequence[int | None] | None) -> None:
        """Row generators from seeds; without any, from this environment's own generator."""
        if seed is None and self.rng:
            return
        if seed is None:
            seeds: list[int | None] = self.np_random.integers(0, 2**31, self.num_envs).tolist()
        elif isinstance(seed, int | np.integer):
            self._np_random, self._np_random_seed = np_random(int(seed))
            seeds = [int(seed) + row for row in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise UsageError(f"{self.num_envs} seeds are needed, got {len(seeds)}.")
        old = self.rng or [None] * self.num_envs
        self.rng = [
            generator if each is None and generator is not None else np_random(each)[0]
            for each, generator in zip(seeds, old, strict=True)
        ]


def _mode(value: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(value)
    except ValueError:
        known = ", ".join(mode.value for mode in AutoresetMode)
        raise UsageError(f"autoreset_mode is one of {known}, not {value!r}.") from None


def _nothing(simulation: Simulation, count: int) -> Episode:
    """Room for episodes."""
    shapes = jax.eval_shape(lambda key: simulation.reset(key)[0], jax.random.key(0))
    return jax.tree.map(lambda leaf: jnp.zeros((count, *leaf.shape), leaf.dtype), shapes)


def _step_all_of(
    simulation: Simulation, episodes: Episode, actions: Array
) -> tuple[Episode, tuple[Array, Array]]:
    """All rows one step on; their observations, signals and rewards side by side, and flags."""
    step = jax.vmap(lambda episode, action: simulation.step(episode, action))
    episodes, observations, signals, rewards, terminated, truncated = step(episodes, actions)
    numbers = [observations, _columns(simulation, signals), rewards[:, None]]
    return episodes, (jnp.concatenate(numbers, axis=1), jnp.stack([terminated, truncated]))


def _reset_some_of(
    simulation: Simulation, episodes: Episode, rows: Array, keys: Array
) -> tuple[Episode, Array]:
    """New episodes in some rows; their observations and signals side by side."""
    new, observations, signals = jax.vmap(simulation.reset)(jax.random.wrap_key_data(keys))
    episodes = jax.tree.map(lambda old, fresh: old.at[rows].set(fresh, mode="drop"), episodes, new)
    return episodes, jnp.concatenate([observations, _columns(simulation, signals)], axis=1)


def _columns(simulation: Simulation, signals: Signals) -> Array:
    """Signals as (N, S), in the order of their names: JAX sorts dictionaries."""
    return jnp.stack([signals[name] for name in simulation.signal_names], axis=1)


_step_all = jax.jit(_step_all_of, donate_argnums=1)
_reset_some = jax.jit(_reset_some_of, donate_argnums=1)
