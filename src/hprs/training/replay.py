"""Keeps a replay buffer on disk, in segments that are written once.

A checkpoint writes what is new since the last one and names the segments that it needs, so that
its cost does not grow with the buffer. Row n of a training belongs at n modulo the buffer's length,
so that a loaded buffer is sampled as the old one would have been.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from hprs.training import files
from hprs.training.arrays import pack, unpack

SEGMENT_BYTES = 8 * 2**20
"""Size of a full segment; the newest one is written again until it is full."""


@dataclass(frozen=True)
class Segment:
    """Some consecutive rows of a training, in a file."""

    name: str
    """The file's name."""
    start: int
    """The first row, counted from the beginning of the training."""
    stop: int
    """The row after the last one."""
    sha256: str
    """Checksum of the file."""


class Ring(Protocol):
    """A replay buffer, whoever's it is."""

    @property
    def capacity(self) -> int:
        """Rows that it holds at most."""
        ...

    @property
    def rows(self) -> int:
        """Rows that it was given since the training began."""
        ...

    @property
    def row_bytes(self) -> int:
        """Memory of a row."""
        ...

    def read(self, places: np.ndarray) -> dict[str, np.ndarray]:
        """Some rows, by their places: name to (P, ...)."""
        ...

    def write(self, places: np.ndarray, rows: Mapping[str, np.ndarray]) -> None:
        """Put rows that `read` returned at their places."""
        ...


def write_segments(folder: Path, ring: Ring, known: Sequence[Segment]) -> tuple[Segment, ...]:
    """Write the rows that no full segment holds yet.

    Args:
        folder: Where the segments lie.
        ring: The replay buffer.
        known: The segments of the last checkpoint.

    Returns:
        The segments that hold the buffer now.
    """
    folder.mkdir(exist_ok=True)
    length, rows = max(1, SEGMENT_BYTES // ring.row_bytes), ring.rows
    first = max(0, rows - ring.capacity)
    kept = [segment for segment in known if segment.stop > first]
    if kept and kept[-1].stop < rows and kept[-1].stop % length:
        kept.pop()
    start = max(first, kept[-1].stop) if kept else first
    while start < rows:
        stop = min(rows, (start // length + 1) * length)
        kept.append(_write_segment(folder, ring, start, stop))
        start = stop
    return tuple(kept)


def load_segments(folder: Path, ring: Ring, segments: Sequence[Segment]) -> None:
    """Fill a replay buffer with what `write_segments` has written.

    Raises:
        RunError: A segment is missing or damaged.
    """
    first = max(0, ring.rows - ring.capacity)
    for segment in segments:
        stored = unpack(files.read_checked(folder / segment.name, segment.sha256))
        skipped = max(0, first - segment.start)
        places = np.arange(segment.start + skipped, segment.stop) % ring.capacity
        ring.write(places, {name: array[skipped:] for name, array in stored.items()})


def prune(folder: Path, segments: Sequence[Segment]) -> None:
    """Delete segments that the committed checkpoint does not need."""
    needed = {segment.name for segment in segments}
    for file in folder.glob("rows-*.npz"):
        if file.name not in needed:
            file.unlink()


def _write_segment(folder: Path, ring: Ring, start: int, stop: int) -> Segment:
    content = pack(ring.read(np.arange(start, stop) % ring.capacity))
    name = f"rows-{start}-{stop}.npz"
    # A name may be taken by a segment that a killed process left, never by one that is needed.
    files.write(folder / name, content)
    return Segment(name, start, stop, files.checksum(content))
