"""Reads a recorded trace from a CSV file, piece by piece."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime, timezone
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from hprs.cli.console import plural
from hprs.cli.trace_columns import CHUNK, Clock, Wanted, too_short
from hprs.errors import TraceError

Cells = list[str]


def csv_chunks(path: Path, wanted: Wanted) -> Iterator[dict[str, Any]]:
    """The signals of a CSV file: a header of column names, and one row a state.

    Raises:
        TraceError: The file cannot be read or is empty, a column is missing, a value is not a
            number, or time stamps do not increase.
    """
    with _errors_of(path), path.open(encoding="utf-8-sig", newline="") as file:
        reader = csv.reader(file)
        header = _header(path, reader)
        columns, time = wanted.find(path, header), wanted.find_time(path, header)
        clock = None if time is None else Clock(time)
        count = 0
        while True:
            line = reader.line_num
            rows = list(islice(reader, CHUNK))
            if not rows:
                break
            piece = _Piece(path, header, rows, line, gaps=wanted.missing == "unknown")
            count += len(piece.rows)
            if clock is not None and time is not None:
                stamps = piece.stamps(time)
                clock.check(stamps, piece.place, lambda row, piece=piece: piece.cell(row, time))
            yield {name: piece.signal(names) for name, names in columns.items()}
        if count < 2:
            raise too_short(path, plural(count, "row"))


@contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise TraceError(f"{path} cannot be read: {error.strerror}.") from None
    except UnicodeDecodeError:
        raise TraceError(f"{path} is not text in UTF-8; a trace is a CSV file.") from None
    except csv.Error as error:
        raise TraceError(f"{path} is not a CSV file: {error}.") from None


def _header(path: Path, reader: Iterator[Cells]) -> Cells:
    cells = next((row for row in reader if not _blank(row)), None)
    if cells is None:
        raise TraceError(f"{path} is empty; it needs a header of signal names and one row a step.")
    header = [cell.strip() for cell in cells]
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise TraceError(f"{path} has column '{twice}' twice.")
    return header


def _blank(row: Cells) -> bool:
    return not any(cell.strip() for cell in row)


class _Piece:
    """Some rows of a file, and where they stand in it."""

    def __init__(
        self, path: Path, header: Sequence[str], rows: list[Cells], line: int, *, gaps: bool
    ) -> None:
        self._path, self._gaps = path, gaps
        self._index: Mapping[str, int] = {name: index for index, name in enumerate(header)}
        self._before, self._all = line, rows
        # Blank lines and errors are rare, and these looks at all rows are quick.
        even = set(map(len, rows)) == {len(header)} and [""] * len(header) not in rows
        self._numbers = None if even else [i for i, row in enumerate(rows) if not _blank(row)]
        self.rows = rows if even else [rows[index] for index in self._numbers or []]
        if not even:
            for row, cells in enumerate(self.rows):
                if len(cells) != len(header):
                    raise TraceError(
                        f"{self.place(row)}: {len(cells)} values below {len(header)} column names."
                    )

    def place(self, row: int) -> str:
        """File and line of a row."""
        last = row if self._numbers is None else self._numbers[row]
        # A quoted cell can go over several lines.
        lines = [1 + sum(cell.count("\n") for cell in cells) for cells in self._all[: last + 1]]
        return f"{self._path}:{self._before + sum(lines)}"

    def cell(self, row: int, column: str) -> str:
        """What stands in a column of a row."""
        return self.rows[row][self._index[column]].strip()

    def signal(self, names: str | list[str]) -> Any:
        """A signal's values; a vector's components are on the last axis."""
        if isinstance(names, str):
            return self._column(names)
        return np.stack([self._column(name) for name in names], axis=-1)

    def stamps(self, column: str) -> Any:
        """Time stamps as numbers."""
        index = self._index[column]
        cells = [row[index] for row in self.rows]
        try:
            return np.array(list(map(int, cells)), np.int64)
        except (ValueError, OverflowError):
            pass
        try:
            return np.array(list(map(float, cells)))
        except ValueError:
            return np.array([self._moment(row, column) for row in range(len(cells))])

    def _moment(self, row: int, column: str) -> float:
        cell = self.cell(row, column)
        try:
            return float(cell)
        except ValueError:
            pass
        try:
            moment = datetime.fromisoformat(cell.replace("Z", "+00:00"))
        except ValueError:
            raise TraceError(
                f"{self.place(row)}: time stamp '{cell}' in column '{column}' is neither a number "
                "nor a date as 2026-01-31T12:00:00."
            ) from None
        return (moment if moment.tzinfo else moment.replace(tzinfo=timezone.utc)).timestamp()

    def _column(self, name: str) -> Any:
        index = self._index[name]
        cells = [row[index] for row in self.rows]
        try:
            values = np.array(list(map(float, cells)))
            # Python reads 1_0 as 10; in a log it is damage.
            clean = "_" not in "".join(cells) and (self._gaps or not np.isnan(values).any())
        except ValueError:
            clean = False
        return values if clean else self._cell_by_cell(name)

    def _cell_by_cell(self, name: str) -> Any:
        return np.array([self._number(row, name) for row in range(len(self.rows))])

    def _number(self, row: int, name: str) -> float:
        cell = self.cell(row, name)
        if not cell and self._gaps:
            return math.nan
        try:
            value = float(cell.replace("_", "?"))
        except ValueError:
            shown = f"'{cell}' is not a number" if cell else "is empty"
            raise TraceError(f"{self.place(row)}: column '{name}' {shown}.") from None
        if math.isnan(value) and not self._gaps:
            raise TraceError(f"{self.place(row)}: column '{name}' is NaN.")
        return value
