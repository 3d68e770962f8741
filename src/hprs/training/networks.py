"""Small networks as trees of arrays: fully connected layers, orthogonally initialised."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from jax import Array


class Layer(NamedTuple):
    """An affine map."""

    weights: Array
    """(inputs, outputs)."""
    bias: Array
    """(outputs,)."""


Network: TypeAlias = list[Layer]
"""Layers, with a nonlinear function between them."""


def make_network(generator: np.random.Generator, sizes: Sequence[int], last_gain: float) -> Network:
    """A network with orthogonal weights and no biases.

    NumPy makes them, not JAX: a QR decomposition inside a program costs a second of compilation,
    and several at once were seen to wait for each other for ever where XLA has two threads.

    Args:
        generator: Of the weights.
        sizes: Of inputs, hidden layers and outputs.
        last_gain: Scale of the last layer's weights; the others have the square root of 2.
    """
    gains = [math.sqrt(2)] * (len(sizes) - 2) + [last_gain]
    return [
        Layer(
            jnp.asarray(_orthogonal(generator, inputs, outputs, gain)),
            jnp.zeros(outputs),
        )
        for gain, (inputs, outputs) in zip(gains, pairwise(sizes), strict=True)
    ]


def make_uniform_network(generator: np.random.Generator, sizes: Sequence[int]) -> Network:
    """A network whose weights and biases are uniform within 1 / sqrt(inputs), as in PyTorch.

    Args:
        generator: Of the weights.
        sizes: Of inputs, hidden layers and outputs.
    """
    layers: Network = []
    for inputs, outputs in pairwise(sizes):
        bound = 1 / math.sqrt(inputs)
        weights = generator.uniform(-bound, bound, (inputs, outputs))
        bias = generator.uniform(-bound, bound, outputs)
        layers.append(Layer(jnp.asarray(weights, float), jnp.asarray(bias, float)))
    return layers


def _orthogonal(generator: np.random.Generator, rows: int, columns: int, gain: float) -> np.ndarray:
    """A matrix whose rows or columns, whichever are fewer, are orthogonal (Saxe et al., 2014)."""
    normal = generator.standard_normal((max(rows, columns), min(rows, columns)))
    basis, triangle = np.linalg.qr(normal)
    # Without this the decomposition would prefer some directions.
    basis = basis * np.sign(np.diag(triangle))
    return (gain * (basis if rows >= columns else basis.T)).astype(np.float32)


def apply(
    network: Network, inputs: Array, activation: Callable[[Array], Array] = jnp.tanh
) -> Array:
    """Outputs (..., outputs) for inputs (..., inputs)."""
    *hidden, last = network
    for layer in hidden:
        inputs = activation(inputs @ layer.weights + layer.bias)
    return inputs @ last.weights + last.bias
