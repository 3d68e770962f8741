"""A tree of arrays as the content of a file, and back."""

from __future__ import annotations

from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from hprs.training.arrays import pack, unpack

Tree = TypeVar("Tree")


def one_of(tree: Tree, index: Any) -> Tree:
    """What belongs to one member of a population, whose members are the first axis."""
    return jax.tree.map(lambda leaf: leaf[index], tree)


def bytes_of(tree: Any) -> int:
    """Memory of all leaves."""
    return sum(leaf.nbytes for leaf in jax.tree.leaves(tree))


def pack_tree(tree: Any) -> bytes:
    """The leaves of a tree, named by their paths."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return pack({_name(path): np.asarray(leaf) for path, leaf in leaves})


def unpack_tree(content: bytes, like: Tree) -> Tree:
    """The inverse of `pack_tree`.

    Args:
        content: What it returned.
        like: A tree of the same structure, whose leaves have the shapes and types.

    Raises:
        ValueError: A leaf is missing or has another shape or type.
    """
    arrays = unpack(content)
    paths, structure = jax.tree_util.tree_flatten_with_path(like)
    leaves: list[Any] = []
    for path, leaf in paths:
        name = _name(path)
        found = arrays.get(name)
        if found is None or found.shape != leaf.shape or found.dtype != leaf.dtype:
            kind = "nothing" if found is None else f"{found.dtype}{list(found.shape)}"
            raise ValueError(f"{name} is {kind}, not {leaf.dtype}{list(leaf.shape)}")
        leaves.append(jnp.asarray(found))
    return jax.tree_util.tree_unflatten(structure, leaves)


def _name(path: Any) -> str:
    return jax.tree_util.keystr(path, simple=True, separator="/")
