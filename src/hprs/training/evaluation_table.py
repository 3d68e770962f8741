"""The table of a run's evaluations: one row an episode, in CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hprs.errors import RunError
from hprs.spec.task import Task
from hprs.training import files
from hprs.training.evaluation import Episode

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
        RunError: The file cannot be read.
    """
    try:
        whole, _ = _split(file)
        return [
            {name: float(value) for name, value in row.items()}
            for row in csv.DictReader(io.StringIO(whole))
        ]
    except (OSError, ValueError, TypeError) as error:
        raise RunError(f"{file} cannot be read: {error}") from None


def repair(file: Path, step: int, newest: str) -> None:
    """Make the table what a checkpoint knows of it.

    Half a row, which a kill or a full disk left, and rows of steps that will be made again are
    removed; the rows of the checkpoint's evaluation are added if they are missing.

    Args:
        file: The table.
        step: The checkpoint's step; -1 without one.
        newest: The rows of its newest evaluation.

    Raises:
        RunError: The file cannot be read.
        OSError: It cannot be written.
    """
    try:
        whole, half = _split(file)
        first, *rows = whole.splitlines(keepends=True)
        numbers = [_step(row) for row in rows]
    except (OSError, ValueError) as error:
        raise RunError(f"{file} cannot be read: {error}") from None
    evaluated = _step(newest) if newest else step + 1
    kept = [row for row, at in zip(rows, numbers, strict=True) if at <= step and at != evaluated]
    wanted = first + "".join(kept) + newest
    if half or wanted != whole:
        files.replace(file, wanted.encode())


def _split(file: Path) -> tuple[str, str]:
    text = file.read_text(encoding="utf-8")
    end = text.rfind("\n") + 1
    return text[:end], text[end:]


def _step(row: str) -> int:
    return int(row.split(",", 1)[0])


def _cell(requirements: Mapping[str, Any], label: str) -> str:
    value = requirements[label]
    return str(int(value)) if isinstance(value, bool) else repr(float(value))
