"""Stable-Baselines3's replay buffers, as they are kept on disk."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

_PARTS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


class ReplayRing:
    """A replay buffer of Stable-Baselines3.

    Args:
        buffer: The buffer.
        rows: How many rows it was given since the training began: one a step of all environments.
    """

    def __init__(self, buffer: Any, rows: int) -> None:
        self._buffer, self._rows = buffer, rows
        self._arrays = dict(_named_arrays(buffer))

    @property
    def capacity(self) -> int:
        """Rows that it holds at most."""
        return self._buffer.buffer_size

    @property
    def rows(self) -> int:
        """Rows that it was given since the training began."""
        return self._rows

    @property
    def row_bytes(self) -> int:
        """Memory of a row."""
        return sum(array[0].nbytes for array in self._arrays.values())

    def read(self, places: np.ndarray) -> dict[str, np.ndarray]:
        """Some rows, by their places."""
        return {name: array[places] for name, array in self._arrays.items()}

    def write(self, places: np.ndarray, rows: Mapping[str, np.ndarray]) -> None:
        """Put rows at their places; the next one goes where it would have gone."""
        for name, array in self._arrays.items():
            array[places] = rows[name]
        self._buffer.pos = self._rows % self.capacity
        self._buffer.full = self._rows >= self.capacity


def _named_arrays(buffer: Any) -> Iterator[tuple[str, np.ndarray]]:
    for name in _PARTS:
        value = getattr(buffer, name)
        if isinstance(value, Mapping):
            yield from ((f"{name}/{key}", array) for key, array in value.items())
        else:
            yield name, value
