"""Distributions of actions: a network's outputs, drawn actions, and what an environment is given.

Noise is drawn apart from its use: XLA would draw it again wherever a fused operation reads it.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from jax import Array

from hprs.errors import UsageError

_ENTROPY = 0.5 * math.log(2 * math.pi * math.e)
_NORMAL = 0.5 * math.log(2 * math.pi)


@dataclass(frozen=True)
class Actions(ABC):
    """Of a policy; known when what uses it is compiled."""

    outputs: int
    """Of the policy's network."""

    @abstractmethod
    def noise(self, key: Array, shape: tuple[int, ...]) -> Array:
        """What `draw` needs, (*shape, outputs)."""

    @abstractmethod
    def draw(self, outputs: Array, log_std: Array, noise: Array) -> Array:
        """Actions, in the learner's own form."""

    @abstractmethod
    def mode(self, outputs: Array) -> Array:
        """The most likely actions."""

    @abstractmethod
    def log_prob(self, outputs: Array, log_std: Array, actions: Array) -> Array:
        """Logarithm of the probability (density) of actions, (...)."""

    @abstractmethod
    def entropy(self, outputs: Array, log_std: Array) -> Array:
        """(...)."""

    @abstractmethod
    def for_environment(self, actions: Array) -> Array:
        """The learner's actions as the environment takes them."""


@dataclass(frozen=True)
class BoxActions(Actions):
    """Independent normal distributions; -1 to 1 is mapped to the bounds, what is beyond clipped.

    An action without two finite bounds is taken as it is, and clipped to the one it has.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    shape: tuple[int, ...]
    """Of the environment's actions."""

    def noise(self, key: Array, shape: tuple[int, ...]) -> Array:
        """Standard normal numbers."""
        return jax.random.normal(key, (*shape, self.outputs))

    def draw(self, outputs: Array, log_std: Array, noise: Array) -> Array:
        """Outputs with noise of the policy's deviation."""
        return outputs + jnp.exp(log_std) * noise

    def mode(self, outputs: Array) -> Array:
        """The means."""
        return outputs

    def log_prob(self, outputs: Array, log_std: Array, actions: Array) -> Array:
        """Of normal distributions."""
        away = (actions - outputs) * jnp.exp(-log_std)
        return jnp.sum(-0.5 * away**2 - log_std - _NORMAL, -1)

    def entropy(self, outputs: Array, log_std: Array) -> Array:
        """Of normal distributions; it depends on their deviations alone."""
        return jnp.broadcast_to(jnp.sum(log_std + _ENTROPY), outputs.shape[:-1])

    def for_environment(self, actions: Array) -> Array:
        """Scaled to the bounds, clipped, in the environment's shape."""
        low, high = np.asarray(self.low, np.float32), np.asarray(self.high, np.float32)
        bounded = np.isfinite(low) & np.isfinite(high)
        least, most = np.where(bounded, low, -1.0), np.where(bounded, high, 1.0)
        centre, half = (least + most) / 2, (most - least) / 2
        scaled = jnp.clip(centre + half * actions, low, high)
        return scaled.reshape(*actions.shape[:-1], *self.shape)


LOG_STD_RANGE = (-20.0, 2.0)
"""Of the deviations that a squashed policy may choose, as in Stable-Baselines3."""
_SQUASH = 1e-6


@dataclass(frozen=True)
class SquashedActions:
    """Hyperbolic tangents of independent normal numbers, mapped to finite bounds.

    A network gives means and logarithms of deviations, side by side.
    """

    outputs: int
    """Components of an action: half of the network's outputs."""
    low: tuple[float, ...]
    high: tuple[float, ...]
    shape: tuple[int, ...]
    """Of the environment's actions."""

    def draw(self, outputs: Array, noise: Array) -> tuple[Array, Array]:
        """Actions in [-1, 1], (..., m), and the logarithms of their densities, (...)."""
        mean, log_std = jnp.split(outputs, 2, -1)
        log_std = jnp.clip(log_std, *LOG_STD_RANGE)
        action = jnp.tanh(mean + jnp.exp(log_std) * noise)
        log_prob = -0.5 * noise**2 - log_std - _NORMAL - jnp.log(1 - action**2 + _SQUASH)
        return action, jnp.sum(log_prob, -1)

    def mode(self, outputs: Array) -> Array:
        """The actions of no noise."""
        return jnp.tanh(jnp.split(outputs, 2, -1)[0])

    def for_environment(self, actions: Array) -> Array:
        """Scaled to the bounds, in the environment's shape."""
        low, high = jnp.asarray(self.low), jnp.asarray(self.high)
        scaled = (low + high) / 2 + (high - low) / 2 * actions
        return scaled.reshape(*actions.shape[:-1], *self.shape)


@dataclass(frozen=True)
class DiscreteActions(Actions):
    """One of several choices; the outputs are logits."""

    start: int

    def noise(self, key: Array, shape: tuple[int, ...]) -> Array:
        """Gumbel numbers."""
        return jax.random.gumbel(key, (*shape, self.outputs))

    def draw(self, outputs: Array, log_std: Array, noise: Array) -> Array:
        """The largest of logits with Gumbel noise: a draw from their softmax."""
        return jnp.argmax(outputs + noise, -1)

    def mode(self, outputs: Array) -> Array:
        """The largest logits."""
        return jnp.argmax(outputs, -1)

    def log_prob(self, outputs: Array, log_std: Array, actions: Array) -> Array:
        """Of a softmax."""
        logs = jax.nn.log_softmax(outputs)
        return jnp.take_along_axis(logs, actions[..., None], -1)[..., 0]

    def entropy(self, outputs: Array, log_std: Array) -> Array:
        """Of a softmax."""
        logs = jax.nn.log_softmax(outputs)
        return -jnp.sum(jnp.exp(logs) * logs, -1)

    def for_environment(self, actions: Array) -> Array:
        """Counted from the space's own start."""
        return actions + self.start


def actions_of(space: gym.Space[Any]) -> BoxActions | DiscreteActions:
    """The distribution for an environment's actions.

    Raises:
        UsageError: They are neither numbers nor one choice.
    """
    if isinstance(space, spaces.Discrete):
        return DiscreteActions(int(space.n), int(space.start))
    if isinstance(space, spaces.Box):
        low, high = space.low.ravel().tolist(), space.high.ravel().tolist()
        return BoxActions(len(low), tuple(low), tuple(high), space.shape)
    raise UsageError(
        f"the JAX trainer cannot handle actions of a {type(space).__name__} space; "
        "use --trainer sb3."
    )


def squashed_actions_of(space: gym.Space[Any]) -> SquashedActions:
    """The distribution for an environment's actions, squashed.

    Raises:
        UsageError: They are not numbers between finite bounds.
    """
    if not isinstance(space, spaces.Box) or not (
        np.isfinite(space.low).all() and np.isfinite(space.high).all()
    ):
        raise UsageError(f"SAC needs actions between finite bounds, not {space}.")
    low, high = space.low.ravel().tolist(), space.high.ravel().tolist()
    return SquashedActions(len(low), tuple(low), tuple(high), space.shape)
