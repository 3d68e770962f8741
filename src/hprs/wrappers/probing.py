"""Lets a vector environment be reset once without moving what it draws afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from typing import Any

from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv, VectorEnv

_GENERATORS = ("_np_random", "rng")
"""Fields that hold a generator: Gymnasium's, and the key of its vector environments in JAX."""


@contextmanager
def undisturbed(envs: VectorEnv[Any, Any, Any]) -> Iterator[None]:
    """Restores the random generators of a vector environment, or of its sub-environments."""
    bare: Any = envs.unwrapped
    if isinstance(bare, AsyncVectorEnv):
        generators = bare.get_attr("np_random")
        yield
        bare.set_attr("np_random", generators)
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
