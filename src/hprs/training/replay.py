"""Keeps a replay buffer on disk, in segments that are written once.

A checkpoint writes what is new since the last one and names the segments that it needs, so that
its cost does not grow with the buffer. Row n of a training belongs at n modulo the buffer's length,
so that a loaded buffer is sampled as the old one would have been.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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


def write_segments(
    folder: Path, buffer: Any, rows: int, known: Sequence[Segment]
) -> tuple[Segment, ...]:
    """Write the rows that no full segment holds yet.

    Args:
        folder: Where the segments lie.
        buffer: A replay buffer of Stable-Baselines3.
        rows: How many rows it was given since the training began.
        known: The segments of the last checkpoint.

    Returns:
        The segments that hold the buffer now.
    """
    folder.mkdir(exist_ok=True)
    arrays = _arrays(buffer)
    length = _segment_rows(arrays)
    first = max(0, rows - buffer.buffer_size)
    kept = [segment for segment in known if segment.stop > first]
    if kept and kept[-1].stop < rows and kept[-1].stop % length:
        kept.pop()
    start = max(first, kept[-1].stop) if kept else first
    while start < rows:
        stop = min(rows, (start // length + 1) * length)
        kept.append(_write_segment(folder, arrays, start, stop, buffer.buffer_size))
        start = stop
    return tuple(kept)


def load_segments(folder: Path, buffer: Any, rows: int, segments: Sequence[Segment]) -> None:
    """Fill a new replay buffer with what `write_segments` has written.

    Raises:
        RunError: A segment is missing or damaged.
    """
    arrays, size = _arrays(buffer), buffer.buffer_size
    first = max(0, rows - size)
    for segment in segments:
        stored = unpack(files.read_checked(folder / segment.name, segment.sha256))
        skipped = max(0, first - segment.start)
        places = np.arange(segment.start + skipped, segment.stop) % size
        for name, array in arrays.items():
            array[places] = stored[name][skipped:]
    buffer.pos, buffer.full = rows % size, rows >= size


def prune(folder: Path, segments: Sequence[Segment]) -> None:
    """Delete segments that the committed checkpoint does not need."""
    needed = {segment.name for segment in segments}
    for file in folder.glob("rows-*.npz"):
        if file.name not in needed:
            file.unlink()


def _arrays(buffer: Any) -> dict[str, np.ndarray]:
    return dict(_named_arrays(buffer))


def _named_arrays(buffer: Any) -> Iterator[tuple[str, np.ndarray]]:
    for name in ("observations", "next_observations", "actions", "rewards", "dones", "timeouts"):
        value = getattr(buffer, name)
        if isinstance(value, Mapping):
            yield from ((f"{name}/{key}", array) for key, array in value.items())
        else:
            yield name, value


def _segment_rows(arrays: Mapping[str, np.ndarray]) -> int:
    return max(1, SEGMENT_BYTES // sum(array[0].nbytes for array in arrays.values()))


def _write_segment(
    folder: Path, arrays: Mapping[str, np.ndarray], start: int, stop: int, size: int
) -> Segment:
    places = np.arange(start, stop) % size
    content = pack({name: array[places] for name, array in arrays.items()})
    name = f"rows-{start}-{stop}.npz"
    # A name may be taken by a segment that a killed process left, never by one that is needed.
    files.write(folder / name, content)
    return Segment(name, start, stop, files.checksum(content))
