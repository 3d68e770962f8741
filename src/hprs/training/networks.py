"""Small networks as trees of arrays: fully connected layers, orthogonally initialised."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import jax
from jax import Array


class Layer(NamedTuple):
    """An affine map."""

    weights: Array
    """(inputs, outputs)."""
    bias: Array
    """(outputs,)."""


Network: TypeAlias = list[Layer]
"""Layers, with a nonlinear function between them."""


def make_network(key: Array, sizes: Sequence[int], last_gain: float) -> Network:
    """A network with orthogonal weights and no biases.

    Args:
        key: JAX key.
        sizes: Of inputs, hidden layers and outputs.
        last_gain: Scale of the last layer's weights; the others have the square root of 2.
    """
    gains = [math.sqrt(2)] * (len(sizes) - 2) + [last_gain]
    keys = jax.random.split(key, len(gains))
    return [
        Layer(
            jax.nn.initializers.orthogonal(gain)(one, (inputs, outputs)),
            jax.numpy.zeros(outputs),
        )
        for one, gain, (inputs, outputs) in zip(keys, gains, pairwise(sizes), strict=True)
    ]


def apply(
    network: Network, inputs: Array, activation: Callable[[Array], Array] = jax.numpy.tanh
) -> Array:
    """Outputs (..., outputs) for inputs (..., inputs)."""
    *hidden, last = network
    for layer in hidden:
        inputs = activation(inputs @ layer.weights + layer.bias)
    return inputs @ last.weights + last.bias
