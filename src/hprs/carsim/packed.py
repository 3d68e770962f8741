"""What makes a compiled call of one world cheap: one array, one kernel.

JAX spends a microsecond or more on every array that enters or leaves a compiled function. One world
has some sixty; packed it is one, and costs a call little more than an empty function does. On a CPU
XLA then starts a kernel for every few operations, of which one world needs many hundred.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.experimental.xla_metadata import set_xla_metadata

Tree = TypeVar("Tree")


@dataclass(frozen=True)
class Layout(Generic[Tree]):
    """Where the leaves of a tree are in its packed form: 32-bit words, bit for bit."""

    structure: Any
    """Of the tree, as JAX describes it."""
    leaves: tuple[tuple[tuple[int, ...], np.dtype], ...]
    """Shape and type of each leaf."""

    @property
    def size(self) -> int:
        """Words of the packed form."""
        return sum(math.prod(shape) for shape, _ in self.leaves)

    def pack(self, tree: Tree) -> Array:
        """The packed form, (size,) uint32; under `jit`."""
        leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(tree)]
        return jnp.concatenate([_words(leaf).ravel() for leaf in leaves])

    def unpack(self, packed: Array) -> Tree:
        """The tree of a packed form; under `jit`."""
        parts, at = [], 0
        for shape, dtype in self.leaves:
            size = math.prod(shape)
            words = packed[at : at + size].reshape(shape)
            at += size
            if dtype == np.bool_:
                parts.append(words != 0)
            else:
                parts.append(jax.lax.bitcast_convert_type(words, dtype))
        return jax.tree.unflatten(self.structure, parts)

    def read(self, packed: Array | np.ndarray) -> Tree:
        """The tree of a packed form as NumPy arrays, without JAX."""
        words = np.asarray(packed)
        parts, at = [], 0
        for shape, dtype in self.leaves:
            size = math.prod(shape)
            part = words[at : at + size]
            at += size
            part = part != 0 if dtype == np.bool_ else part.view(dtype)
            parts.append(part.reshape(shape))
        return jax.tree.unflatten(self.structure, parts)


def layout_of(tree: Tree) -> Layout[Tree]:
    """The layout of trees like this one.

    Args:
        tree: Of arrays, or of what `jax.eval_shape` returns; 32-bit types and bool.
    """
    leaves, structure = jax.tree.flatten(tree)
    kinds = tuple((tuple(leaf.shape), np.dtype(leaf.dtype)) for leaf in leaves)
    wrong = {str(dtype) for _, dtype in kinds if dtype != np.bool_ and dtype.itemsize != 4}
    if wrong:
        raise TypeError(
            f"Only 32-bit arrays and bool can be packed, not {', '.join(sorted(wrong))}."
        )
    return Layout(structure, kinds)


def _words(leaf: Array) -> Array:
    if leaf.dtype == jnp.bool_:
        return leaf.astype(jnp.uint32)
    return jax.lax.bitcast_convert_type(leaf, jnp.uint32)


def as_one_kernel(function: Callable[..., Array]) -> Callable[..., Array]:
    """The compiled function, on a CPU as a single kernel: half the time for one world.

    It leaves nothing to parallel threads and little to vector registers; batches lose by it. Sums
    of products are rounded once there, so that results may differ in the last places.

    Args:
        function: Of arrays to one array.
    """
    compiled = jax.jit(function)

    @jax.jit
    def whole(*arguments: Any) -> Array:
        result = compiled(*arguments)
        if jax.default_backend() != "cpu":
            return result
        # XLA's own marks of what it emits as a whole; a version without them ignores them.
        marked = set_xla_metadata(result, inlineable="false", xla_cpu_small_call="true")
        return cast(Array, marked)

    return whole
