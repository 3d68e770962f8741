"""Reads a recorded trace from a CSV file."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hprs.cli.console import plural
from hprs.errors import TraceError, UsageError, did_you_mean
from hprs.semantics.plan import plan_of
from hprs.spec.task import Task


def read_trace(path: Path, task: Task) -> Mapping[str, npt.NDArray[np.float64]]:
    """The signals of a trace: columns are signals, rows are steps.

    A vector has the columns `name[0]`, `name[1]` and so on. Other columns are left out.

    Raises:
        UsageError: There is no such file.
        TraceError: It cannot be read or is empty, a column is missing, or a value is not a number.
    """
    if path.is_dir():
        raise UsageError(f"'{path}' is a folder; a trace is a CSV file.")
    if not path.exists():
        near = [other.name for other in path.parent.glob(f"*{path.suffix}")]
        raise UsageError(f"there is no trace file '{path}'.{did_you_mean(path.name, near)}")
    header, rows = _read(path)
    used = set(plan_of(task).signals)
    trace: dict[str, npt.NDArray[np.float64]] = {}
    for signal in task.signals:
        names = (
            [signal.name]
            if signal.length is None
            else [f"{signal.name}[{i}]" for i in range(signal.length)]
        )
        if signal.name not in used and not set(names) <= set(header):
            continue
        columns = [_column(path, header, rows, name) for name in names]
        trace[signal.name] = columns[0] if signal.length is None else np.stack(columns, axis=-1)
    return trace


def _read(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Header, and the rows below it with their line numbers."""
    rows = _rows(path)
    if not rows:
        raise TraceError(f"{path} is empty; it needs a header of signal names and one row a step.")
    header = rows[0][1]
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise TraceError(f"{path} has column '{twice}' twice.")
    if len(rows) < 3:
        raise TraceError(
            f"{path} has {plural(len(rows) - 1, 'row')}; it needs the initial state and at least "
            "one step."
        )
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise TraceError(f"{path}:{line}: {len(row)} values below {len(header)} column names.")
    return header, rows[1:]


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """All rows with their line numbers; blank lines are skipped."""
    rows: list[tuple[int, list[str]]] = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            for row in reader:
                if any(cell.strip() for cell in row):
                    rows.append((reader.line_num, [cell.strip() for cell in row]))
    except OSError as error:
        raise TraceError(f"{path} cannot be read: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise TraceError(f"{path} is not text in UTF-8; a trace is a CSV file.") from None
    except csv.Error as error:
        raise TraceError(f"{path} is not a CSV file: {error}.") from None
    return rows


def _column(
    path: Path, header: Sequence[str], rows: Sequence[tuple[int, list[str]]], name: str
) -> npt.NDArray[np.float64]:
    if name not in header:
        raise TraceError(
            f"{path} has no column '{name}'; it has {', '.join(header)}."
            f"{did_you_mean(name, header)}"
        )
    index = header.index(name)
    values: list[float] = []
    for line, row in rows:
        try:
            # Python reads 1_0 as 10; in a log it is damage.
            value = float(row[index].replace("_", "?"))
        except ValueError:
            shown = f"'{row[index]}' is not a number" if row[index] else "is empty"
            raise TraceError(f"{path}:{line}: column '{name}' {shown}.") from None
        if math.isnan(value):
            raise TraceError(f"{path}:{line}: column '{name}' is NaN.")
        values.append(value)
    return np.array(values)
