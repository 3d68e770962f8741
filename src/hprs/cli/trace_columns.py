"""Which columns of a log are a task's signals, and whether its time stamps increase."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from hprs.errors import TraceError, UsageError, did_you_mean
from hprs.semantics.plan import plan_of
from hprs.semantics.trace import Missing
from hprs.spec.task import Signal, Task

CHUNK = 16_384
"""States that are read and assessed at once: few enough that memory stays small."""
TIME_COLUMNS = ("time", "timestamp", "stamp", "t")
"""Names of columns that hold time stamps, in any case, unless they are a signal's."""


def parse_columns(given: Sequence[str]) -> dict[str, str]:
    """Signal to column, of pairs `SIGNAL=COLUMN`.

    Raises:
        UsageError: One is no such pair.
    """
    pairs: dict[str, str] = {}
    for pair in given:
        name, separator, column = pair.partition("=")
        if not (name and separator and column):
            raise UsageError(f"--column takes SIGNAL=COLUMN, not '{pair}'.")
        pairs[name] = column
    return pairs


@dataclass(frozen=True)
class Wanted:
    """What is wanted of a log."""

    task: Task
    missing: Missing = "error"
    """What to do about signals that the log lacks."""
    columns: Mapping[str, str] = field(default_factory=dict[str, str])
    """Signal to its column, where that has another name."""
    time: str | None = None
    """The column of time stamps; None: one of `TIME_COLUMNS`, if there is one; "": none."""
    ticks: str | None = None
    """The topic of a rosbag whose messages are the policy's ticks."""
    advice: str = ""
    """A sentence for errors about missing columns."""
    unused: bool = True
    """Whether signals that no requirement needs are wanted, where the log has them."""

    def __post_init__(self) -> None:
        """Check the names of signals."""
        known = [signal.name for signal in self.task.signals]
        for name in self.columns:
            if name not in known:
                raise UsageError(
                    f"--column: the task has no signal '{name}'.{did_you_mean(name, known)}"
                )

    @property
    def signals(self) -> list[Signal]:
        """The signals to look for."""
        used = plan_of(self.task).signals
        return [signal for signal in self.task.signals if self.unused or signal.name in used]

    def find(self, path: Path, header: Sequence[str], *, lists: bool = False) -> dict[str, Any]:
        """Signal to its column, or to a list of columns for a vector.

        Args:
            path: The file, for messages.
            header: Its columns.
            lists: Whether one column can hold a vector.

        Raises:
            TraceError: A column that is asked for is not there.
        """
        used = plan_of(self.task).signals
        known, found = set(header), dict[str, Any]()
        for signal in self.signals:
            base = self.columns.get(signal.name, signal.name)
            if signal.length is None or (lists and base in known):
                names: Any = base
                lacking = [base] if base not in known else []
            else:
                names = [f"{base}[{index}]" for index in range(signal.length)]
                lacking = [name for name in names if name not in known]
            if not lacking:
                found[signal.name] = names
            elif signal.name in self.columns or (self.missing == "error" and signal.name in used):
                raise TraceError(
                    f"{path} has no column '{lacking[0]}'; it has {', '.join(header)}."
                    f"{did_you_mean(lacking[0], header)}{self.advice}"
                )
        if used and not found.keys() & set(used):
            raise TraceError(f"{path} has none of the signals; it has {', '.join(header)}.")
        return found

    def find_time(self, path: Path, header: Sequence[str]) -> str | None:
        """The column of time stamps.

        Raises:
            TraceError: The one that is asked for is not there.
        """
        if self.time is not None:
            if self.time and self.time not in header:
                raise TraceError(
                    f"{path} has no column '{self.time}' for --time; it has {', '.join(header)}."
                    f"{did_you_mean(self.time, header)}"
                )
            return self.time or None
        taken = {signal.name for signal in self.task.signals} | set(self.columns.values())
        candidates = [name for name in header if name not in taken]
        return next((name for name in candidates if name.lower() in TIME_COLUMNS), None)


class Clock:
    """Checks that time stamps increase, from piece to piece of a log.

    Args:
        column: The name of their column.
    """

    def __init__(self, column: str) -> None:
        self._column = column
        self._last: tuple[float, str] = (-math.inf, "")

    def check(self, values: Any, place: Callable[[int], str], shown: Callable[[int], str]) -> None:
        """Check the next stamps.

        Args:
            values: The stamps, an array of integers or floats.
            place: Names the file and the row of a stamp by its index.
            shown: The stamp as the log has it.

        Raises:
            TraceError: One does not come after the one before.
        """
        if not len(values):
            return
        # Integers stay integers: as floats, nanoseconds since 1970 are the same for a quarter of a
        # microsecond.
        first = [values[0].item() > self._last[0]]
        wrong = np.flatnonzero(~np.concatenate([first, values[1:] > values[:-1]]))
        if wrong.size:
            index = int(wrong[0])
            previous = shown(index - 1) if index else self._last[1]
            raise TraceError(
                f"{place(index)}: time stamps must increase, but '{self._column}' is "
                f"{shown(index)} after {previous or 'nothing'}."
            )
        self._last = (values[-1].item(), shown(len(values) - 1))


def too_short(path: Path, rows: str) -> TraceError:
    """The error of a log without a step."""
    return TraceError(f"{path} has {rows}; it needs the initial state and at least one step.")
