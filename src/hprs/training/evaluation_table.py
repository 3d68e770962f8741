"""The table of a run's evaluations: one row an episode, in CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hprs.errors import RunError
from hprs.spec.task import Task
from hprs.training import files
from hprs.training.evaluation import Episode

Columns: TypeAlias = dict[str, npt.NDArray[np.float64]]

FIXED_COLUMNS = ("step", "seed", "length", "return", "pam", "safe", "target")


def columns(task: Task) -> list[str]:
    """The header of a task's table."""
    return [*FIXED_COLUMNS, *(f"{r.kind}.{r.label}" for r in task.requirements)]


def header(task: Task) -> str:
    """The first line of a task's table."""
    return ",".join(columns(task)) + "\n"


def format_rows(task: Task, step: int, episodes: Sequence[Episode]) -> str:
    """The rows of an evaluation after so many steps of training."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for episode in episodes:
        found = episode.assessment
        writer.writerow(
            [
                step,
                episode.seed,
                found.length,
                repr(episode.total),
                repr(float(found.pam)),
                int(found.safe),
                int(found.target),
                *(_cell(found.requirements, label) for label in task.labels),
            ]
        )
    return text.getvalue()


def read(file: Path) -> list[dict[str, float]]:
    """All complete rows, as numbers.

    Raises:
        RunError: The file is missing or damaged.
    """
    first, rows, _ = _split(file)
    names = first.rstrip("\n").split(",")
    return [
        dict(zip(names, _numbers(file, line, row, len(names)), strict=True))
        for line, row in enumerate(rows, start=2)
    ]


def read_columns(file: Path) -> Columns:
    """All complete rows, as an array a column: as `read`, and many times as fast.

    Raises:
        RunError: The file is missing or damaged.
    """
    first, rows, _ = _split(file)
    names = first.rstrip("\n").split(",")
    try:
        values = np.loadtxt(rows, delimiter=",", ndmin=2) if rows else np.empty((0, len(names)))
    except ValueError:
        values = np.empty((0, 0))
    if values.shape[1] != len(names):
        # It says which line is wrong.
        found = read(file)
        return {name: np.array([row[name] for row in found]) for name in names}
    return dict(zip(names, values.T, strict=True))


def is_empty(file: Path) -> bool:
    """Whether nothing was ever recorded.

    Raises:
        RunError: The file is missing or damaged.
    """
    _, rows, half = _split(file)
    return not rows and not half


def repair(file: Path, step: int, newest: str) -> int:
    """Make the table what a checkpoint knows of it.

    Half a row, which a kill or a full disk left, and rows of steps that will be made again are
    removed; the rows of the checkpoint's evaluation are added if they are missing.

    Args:
        file: The table.
        step: The checkpoint's step.
        newest: The rows of its newest evaluation.

    Returns:
        How many rows it has then.

    Raises:
        RunError: The file is missing or damaged.
        OSError: It cannot be written.
    """
    first, rows, half = _split(file)
    width = first.count(",") + 1
    numbers = [_numbers(file, line, row, width)[0] for line, row in enumerate(rows, start=2)]
    added = newest.splitlines(keepends=True)
    evaluated = float(newest.split(",", 1)[0]) if newest else step + 1
    kept = [row for row, at in zip(rows, numbers, strict=True) if at <= step and at != evaluated]
    if half or kept + added != rows:
        files.replace(file, "".join([first, *kept, *added]).encode())
    return len(kept) + len(added)


def _split(file: Path) -> tuple[str, list[str], str]:
    """The header, the complete rows, and what is left of half a row."""
    if not file.is_file():
        raise RunError(f"{file} is missing. Put back a copy of it. {_ANEW}")
    text = files.read(file).decode("utf-8", "replace")
    first, *rows = text.splitlines(keepends=True) or [""]
    if not (first.startswith(",".join(FIXED_COLUMNS)) and first.endswith("\n")):
        raise RunError(f"{file} is damaged: line 1 is no header. Put back a copy of it. {_ANEW}")
    half = rows.pop() if rows and not rows[-1].endswith("\n") else ""
    return first, rows, half


def _numbers(file: Path, line: int, row: str, width: int) -> list[float]:
    try:
        found = [float(value) for value in row.split(",")]
    except ValueError:
        found = []
    if len(found) != width:
        raise RunError(
            f"{file} is damaged: line {line} is no row. Put back a copy of the file, or delete "
            "that line."
        )
    return found


_ANEW = "To train anew, choose another folder with --out."


def _cell(requirements: Mapping[str, Any], label: str) -> str:
    value = requirements[label]
    return str(int(value)) if isinstance(value, bool) else repr(float(value))
