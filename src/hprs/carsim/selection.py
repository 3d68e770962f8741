"""One track of a stack, without a copy of its arrays."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, cast

from jax import Array

from hprs.carsim.track import Track

_SMALL = ("length", "max_clearance", "origin", "columns")
"""Arrays that functions read as a whole."""


@dataclass(frozen=True)
class _Rows:
    """An array of a stack whose rows are looked up where they lie.

    With `stack[index]` in a batch XLA would copy every array of a track for every world: that made
    a step of 1,024 worlds three times slower.
    """

    stack: Array
    index: Array

    @property
    def dtype(self) -> Any:
        return self.stack.dtype

    @property
    def shape(self) -> tuple[int, ...]:
        return self.stack.shape[1:]

    def __getitem__(self, rows: Any) -> Array:
        return self.stack[self.index, rows]


def selected(tracks: Track, index: Array) -> Track:
    """Track number `index` of a stack; to be read by functions, not passed through JAX.

    Args:
        tracks: From `stack_tracks`.
        index: (), integer.
    """
    parts: dict[str, Any] = {}
    for name in (field.name for field in fields(Track)):
        stack = getattr(tracks, name)
        parts[name] = stack[index] if name in _SMALL else _Rows(stack, index)
    return cast(Track, Track(**parts))
