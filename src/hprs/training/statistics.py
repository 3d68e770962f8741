"""Running mean and variance of what a learner sees, frozen while it uses them."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

SMALLEST_VARIANCE = 1e-8
"""Added to a variance before its root is taken: what never changes is not blown up."""
LARGEST = 10.0
"""Normalised values are clipped to this, either way, as in Stable-Baselines3's VecNormalize."""
_PRIOR = 1e-4
"""Weight of the first guess, mean 0 and variance 1, in samples."""


class Statistics(NamedTuple):
    """Of vectors, component by component."""

    mean: Array
    """(n,)."""
    variance: Array
    """(n,)."""
    count: Array
    """Of the samples so far, ()."""

    @property
    def deviation(self) -> Array:
        """What centred values are divided by, (n,)."""
        return jnp.sqrt(self.variance + SMALLEST_VARIANCE)

    def normalised(self, values: Array) -> Array:
        """Values (..., n), centred, scaled and clipped."""
        return jnp.clip((values - self.mean) / self.deviation, -LARGEST, LARGEST)

    def updated(self, values: Array, valid: Array) -> Statistics:
        """The statistics with more samples.

        Args:
            values: (..., n).
            valid: Which of them count, (...) bool.
        """
        flat = values.reshape(-1, *self.mean.shape)
        weights = valid.reshape(-1).astype(flat.dtype)
        weights = weights.reshape(-1, *(1 for _ in self.mean.shape))
        number = jnp.sum(weights)
        share = 1 / jnp.maximum(number, 1)
        mean = jnp.sum(flat * weights, 0) * share
        variance = jnp.sum((flat - mean) ** 2 * weights, 0) * share
        # Chan et al.: the variance of two sets of samples together.
        total = self.count + number
        shift = mean - self.mean
        squares = self.variance * self.count + variance * number
        squares = squares + shift**2 * self.count * number / total
        return Statistics(self.mean + shift * number / total, squares / total, total)


def unseen(shape: tuple[int, ...]) -> Statistics:
    """Statistics before the first sample: mean 0, variance 1."""
    return Statistics(jnp.zeros(shape), jnp.ones(shape), jnp.asarray(_PRIOR, jnp.float32))
