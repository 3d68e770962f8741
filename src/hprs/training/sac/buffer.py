"""The transitions that a population remembers: a ring that all of its members fill in step."""

from __future__ import annotations

from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from hprs.spec.namespace import Array
from hprs.training.frames import Frames
from hprs.training.sac.learner import Batch


class Buffer(NamedTuple):
    """C steps of R environments, the members' one after the other, (C, R, ...)."""

    frame: Array
    """Of the states left, (C, R, F)."""
    reached: Array
    """Of the states reached; where an episode ended, its final one, (C, R, F)."""
    action: Array
    """In [-1, 1], (C, R, m)."""
    reward: Array
    terminated: Array
    truncated: Array
    valid: Array
    """False where a step only reset an environment."""
    age: Array
    """Steps since the episode began, but no more than frames reach back, (C, R) uint8."""


def empty(capacity: int, rows: int, frames: Frames, outputs: int, xp: ModuleType = jnp) -> Buffer:
    """A ring without transitions; `xp` is the namespace of its arrays, NumPy's or JAX's."""
    size, kind = (capacity, rows), jnp.zeros(()).dtype
    return Buffer(
        frame=xp.zeros((*size, len(frames.newest)), kind),
        reached=xp.zeros((*size, len(frames.newest)), kind),
        action=xp.zeros((*size, outputs), kind),
        reward=xp.zeros(size, kind),
        terminated=xp.zeros(size, bool),
        truncated=xp.zeros(size, bool),
        valid=xp.zeros(size, bool),
        age=xp.zeros(size, xp.uint8),
    )


def bytes_of_row(frames: Frames, outputs: int) -> int:
    """Memory of one transition."""
    return 4 * (2 * len(frames.newest) + outputs + 1) + 4


def added(buffer: Buffer, row: Buffer, count: Array) -> Buffer:
    """The ring with one more step.

    Args:
        buffer: The ring.
        row: The step, (R, ...).
        count: Steps that were added before.
    """
    at = count % len(buffer.reward)
    return jax.tree.map(
        lambda all_, one: jax.lax.dynamic_update_index_in_dim(all_, one, at, 0), buffer, row
    )


def sampled(
    buffer: Buffer,
    frames: Frames,
    bits: Array,
    count: Any,
    members: int,
    xp: ModuleType = jnp,
) -> Batch:
    """Transitions of each member, drawn with replacement, (M, B, ...).

    Args:
        buffer: The ring.
        frames: What its frames are of.
        bits: 32 random bits for each transition, (M, B) uint32.
        count: Steps that were added so far; at least 1.
        members: How many.
        xp: The namespace of the arrays, NumPy's or JAX's.
    """
    capacity, rows = buffer.reward.shape
    each = rows // members
    # Of the oldest steps of a full ring, those before may have been written over.
    full = count >= capacity
    kept = xp.where(full, capacity - frames.depth, xp.minimum(count, capacity))
    drawn = bits % xp.uint32(kept * each)
    oldest = xp.where(full, count % capacity + frames.depth, 0)
    time = (oldest + (drawn // each).astype(xp.int32)) % capacity
    row = xp.arange(members)[:, None] * each + (drawn % each).astype(xp.int32)
    age = buffer.age[time, row].astype(xp.int32)
    history = [
        buffer.frame[(time - xp.minimum(back, age)) % capacity, row]
        for back in range(frames.depth + 1)
    ]
    following = [buffer.reached[time, row], *history[: frames.depth]]
    return Batch(
        observation=_stacked(history, frames, xp),
        action=buffer.action[time, row],
        reward=buffer.reward[time, row],
        terminated=buffer.terminated[time, row],
        truncated=buffer.truncated[time, row],
        valid=buffer.valid[time, row],
        reached=_stacked(following, frames, xp),
    )


def frame_of(observation: Array, frames: Frames) -> Array:
    """What of an observation is remembered, (..., F)."""
    if not frames.depth:
        return observation
    return observation[..., np.asarray(frames.newest)]


def _stacked(history: list[Array], frames: Frames, xp: ModuleType) -> Array:
    """Observations (..., n) from frames (..., F), the newest first."""
    if not frames.depth:
        return history[0]
    together = xp.concatenate(history, -1)
    width = len(frames.newest)
    return together[..., np.asarray(frames.lag) * width + np.asarray(frames.column)]
