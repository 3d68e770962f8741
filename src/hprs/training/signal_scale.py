"""A task's signals as numbers of like size, for a critic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.semantics.plan import plan_of
from hprs.spec.task import Task

_LARGEST = 2.0
"""Of a scaled signal: a value far outside its range tells a critic no more."""


@dataclass(frozen=True)
class SignalScale:
    """Maps the range of every signal that a task uses to [-1, 1].

    A range without two finite ends has no middle: x / (1 + |x|) stands in, and 1 for infinity.
    """

    names: tuple[str, ...]
    """Signals, in the order of their columns."""
    lengths: tuple[int | None, ...]
    """Components of vectors; None for a number."""
    centre: tuple[float, ...]
    half: tuple[float, ...]
    """Half of the range; infinite where it has no two finite ends."""

    @property
    def size(self) -> int:
        """Numbers of all signals together."""
        return len(self.centre)

    def stacked(self, signals: Mapping[str, Any]) -> Array:
        """Raw values (..., S) of a batch of states, under `jit`."""
        parts = [
            jnp.asarray(signals[name])[..., None] if length is None else jnp.asarray(signals[name])
            for name, length in zip(self.names, self.lengths, strict=True)
        ]
        return jnp.concatenate([part.astype(float) for part in parts], -1)

    def by_name(self, raw: Array) -> dict[str, Array]:
        """The inverse of `stacked`."""
        found: dict[str, Array] = {}
        at = 0
        for name, length in zip(self.names, self.lengths, strict=True):
            end = at + (1 if length is None else length)
            found[name] = raw[..., at] if length is None else raw[..., at:end]
            at = end
        return found

    def __call__(self, raw: Array) -> Array:
        """Scaled values (..., S)."""
        centre, half = np.asarray(self.centre, np.float32), np.asarray(self.half, np.float32)
        bounded = np.isfinite(half)
        scaled = jnp.clip((raw - centre) / np.where(bounded, half, 1), -_LARGEST, _LARGEST)
        squashed = jnp.sign(raw) * (1 - 1 / (1 + jnp.abs(raw)))
        return jnp.where(bounded, scaled, squashed)


def signal_scale(task: Task) -> SignalScale:
    """The scale of a task's signals."""
    names = plan_of(task).signals
    declared = {signal.name: signal for signal in task.signals}
    lengths: list[int | None] = []
    centre: list[float] = []
    half: list[float] = []
    for name in names:
        low, high = task.ranges[name].low, task.ranges[name].high
        bounded = np.isfinite([low, high]).all() and high > low
        length = declared[name].length
        count = 1 if length is None else length
        lengths.append(length)
        centre += [(low + high) / 2 if bounded else 0.0] * count
        half += [(high - low) / 2 if bounded else float("inf")] * count
    return SignalScale(names, tuple(lengths), tuple(centre), tuple(half))
