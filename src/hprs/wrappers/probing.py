"""Lets a vector environment be reset or stepped without moving what it draws afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from typing import Any

import numpy as np
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv

from hprs.wrappers.resets import Mask

_GENERATORS = ("_np_random", "rng")
"""Fields that hold a generator: Gymnasium's, and the key of its vector environments in JAX."""


@contextmanager
def undisturbed(envs: VectorEnv[Any, Any, Any]) -> Iterator[None]:
    """Restores the random generators of a vector environment, or of its sub-environments."""
    bare: Any = envs.unwrapped
    if isinstance(bare, AsyncVectorEnv):
        generators = bare.get_attr("_np_random")
        yield
        bare.set_attr("_np_random", generators)
        return
    owners = [env.unwrapped for env in bare.envs] if isinstance(bare, SyncVectorEnv) else [bare]
    saved = [
        {name: deepcopy(vars(owner)[name]) for name in _GENERATORS if name in vars(owner)}
        for owner in owners
    ]
    yield
    for owner, fields in zip(owners, saved, strict=True):
        vars(owner).pop("_np_random", None)
        vars(owner).update(fields)


@contextmanager
def undisturbed_rows(envs: VectorEnv[Any, Any, Any], mask: Mask) -> Iterator[None]:
    """Restores the generators of an `AsyncVectorEnv`'s sub-environments in the rows of a mask."""
    bare: Any = envs.unwrapped
    if not isinstance(bare, AsyncVectorEnv):
        yield
        return
    generators = bare.get_attr("_np_random")
    yield
    # `set_attr` sets all rows. In those that go on, a copy of the generator would tear it from
    # whatever else of the environment draws from it.
    pipes = [bare.parent_pipes[row] for row in np.flatnonzero(mask)]
    for row, pipe in zip(np.flatnonzero(mask), pipes, strict=True):
        pipe.send(("_setattr", ("_np_random", generators[row])))
    for pipe in pipes:
        pipe.recv()
