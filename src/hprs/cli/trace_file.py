"""Reads a recorded trace, piece by piece: a CSV file, a Parquet file or a rosbag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hprs.cli.trace_columns import Wanted
from hprs.cli.trace_csv import csv_chunks
from hprs.errors import UsageError, did_you_mean

PARQUET, BAG = (".parquet", ".pq"), (".bag", ".mcap", ".db3")
"""Endings of files that are not CSV; a rosbag of ROS 2 can be a folder, too."""


@dataclass(frozen=True)
class Recording:
    """A trace that is being read."""

    chunks: Iterator[dict[str, Any]]
    """Its pieces: signal name to values over time."""
    notes: list[str] = field(default_factory=list[str])
    """What a reader of the assessment should know; complete after the last piece."""


def open_trace(path: Path, wanted: Wanted) -> Recording:
    """A trace, of which nothing has been read yet.

    Raises:
        UsageError: There is no such file, or an option does not suit it.
        TraceError: While its pieces are read: it cannot be read or is empty, a column is missing, a
            value is not a number, or time stamps do not increase.
    """
    if is_bag(path):
        from hprs.cli.trace_bag import bag_chunks

        _require(path)
        if wanted.time is not None:
            raise UsageError("--time is for tables; a rosbag has time stamps of its own.")
        notes: list[str] = []
        return Recording(bag_chunks(path, wanted, notes), notes)
    if path.is_dir():
        raise UsageError(
            f"'{path}' is a folder; a trace is a CSV file, a Parquet file or a rosbag."
        )
    _require(path)
    if wanted.ticks is not None:
        raise UsageError(f"--ticks is for rosbags; in '{path}' every row is one.")
    if path.suffix in PARQUET:
        from hprs.cli.trace_parquet import parquet_chunks

        return Recording(parquet_chunks(path, wanted))
    return Recording(csv_chunks(path, wanted))


def is_bag(path: Path) -> bool:
    """Whether a file or a folder is a rosbag, by its name or by what lies in it."""
    return path.suffix in BAG or (path / "metadata.yaml").exists()


def _require(path: Path) -> None:
    if not path.exists():
        near = [other.name for other in path.parent.glob(f"*{path.suffix}")]
        raise UsageError(f"there is no trace file '{path}'.{did_you_mean(path.name, near)}")
