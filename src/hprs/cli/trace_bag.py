"""Reads a recorded trace from a rosbag of ROS 1 or ROS 2, at the ticks of a policy.

A field of a topic's messages is a column, as `/odom.twist.twist.linear.x` or `/scan.ranges[3]`; a
signal `v` without another column is `/v.data`, as of the messages of std_msgs. A state is what was
last heard of every column at a tick, or before it: the time a message was recorded counts. What was
not heard yet is NaN where missing values are allowed; elsewhere such ticks are left out.

What a task reads from `action` is the action that led to a state. Where it is a column of the topic
of the ticks, that is the message before the tick; `last_action` is one tick earlier still.
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hprs.cli.console import plural
from hprs.cli.trace_columns import CHUNK, Wanted, too_short
from hprs.errors import MissingExtraError, TraceError, UsageError, did_you_mean
from hprs.semantics.plan import plan_of
from hprs.spec.task import Signal

_STEP = re.compile(r"([A-Za-z_]\w*)((?:\[\d+\])*)")


def bag_chunks(path: Path, wanted: Wanted, notes: list[str]) -> Iterator[dict[str, Any]]:
    """The signals of a rosbag, one state a tick.

    Args:
        path: The bag: a file of ROS 1, a file or a folder of ROS 2.
        wanted: What is wanted of it.
        notes: Where to say what was left out.

    Raises:
        TraceError: The bag cannot be read, a topic or a field is missing, or a value is no number.
        UsageError: The topic of the ticks is not named, or not there.
        MissingExtraError: rosbags is not installed.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("rosbags", "ros") from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as bag:
            states = _States(path, bag, wanted)
            yield from states.chunks()
            notes += states.notes
    except (AnyReaderError, OSError) as error:
        reason = " ".join(map(str, error.args)).rstrip(".")
        raise TraceError(f"{path} cannot be read as a rosbag: {reason}.") from None


@dataclass(frozen=True)
class _Read:
    """How a signal is read."""

    signal: Signal
    topic: str
    column: str
    value: Callable[[Any], Any]
    lag: int
    """Ticks between a value and the state it belongs to."""


class _States:
    """The states of a bag at its ticks."""

    def __init__(self, path: Path, bag: Any, wanted: Wanted) -> None:
        self._path, self._bag, self._wanted = path, bag, wanted
        self._topics = {name: topic for name, topic in bag.topics.items() if topic.msgcount}
        self.ticks = self._ticks()
        self._reads = [read for signal in wanted.signals if (read := self._read(signal))]
        if not self._reads:
            raise TraceError(f"{path} has none of the signals; it has {', '.join(self._topics)}.")
        self._by_topic: dict[str, list[_Read]] = {self.ticks: []}
        for read in self._reads:
            self._by_topic.setdefault(read.topic, []).append(read)
        self._skipped = 0

    @property
    def notes(self) -> list[str]:
        """What was left out."""
        if not self._skipped:
            return []
        first = "first tick" if self._skipped == 1 else f"first {self._skipped:,} ticks"
        return [f"Left out: the {first} of {self.ticks}, before every signal had a value."]

    def chunks(self) -> Iterator[dict[str, Any]]:
        """Pieces of the trace.

        Raises:
            TraceError: There is not one step, or a value is no number.
        """
        rows: list[Sequence[Any]] = []
        count = 0
        for row in self._rows():
            rows.append(row)
            count += 1
            if len(rows) == CHUNK:
                yield self._chunk(rows)
                rows = []
        if count < 2:
            ticks = f"{plural(count, 'tick')} of {self.ticks}"
            complete = "" if self._wanted.missing == "unknown" else " with a value of every signal"
            raise too_short(self._path, ticks + complete)
        if rows:
            yield self._chunk(rows)

    def _chunk(self, rows: list[Sequence[Any]]) -> dict[str, Any]:
        columns = zip(*rows, strict=True)
        return {
            read.signal.name: np.array(column)
            for read, column in zip(self._reads, columns, strict=True)
        }

    def _rows(self) -> Iterator[Sequence[Any]]:
        held: dict[str, Any] = {}
        ticks: deque[Mapping[str, Any]] = deque(maxlen=1 + max(r.lag for r in self._reads))
        tick: int | None = None
        connections = [c for c in self._bag.connections if c.topic in self._by_topic]
        for connection, stamp, data in self._bag.messages(connections=connections):
            # What was recorded at the same moment as a tick belongs to its state.
            if tick is not None and stamp > tick:
                ticks.append(dict(held))
                yield from self._row(ticks)
                tick = None
            if connection.topic == self.ticks:
                if tick is not None:
                    raise TraceError(
                        f"{self._path}: time stamps must increase, but {self.ticks} has two "
                        f"messages at {stamp / 1e9:.9f} s."
                    )
                tick = stamp
            reads = self._by_topic[connection.topic]
            if reads:
                message = self._bag.deserialize(data, connection.msgtype)
                for read in reads:
                    held[read.column] = self._checked(read, message, stamp)
        if tick is not None:
            ticks.append(dict(held))
            yield from self._row(ticks)

    def _row(self, ticks: deque[Mapping[str, Any]]) -> Iterator[Sequence[Any]]:
        row = [
            ticks[-1 - read.lag].get(read.column) if read.lag < len(ticks) else None
            for read in self._reads
        ]
        if all(value is not None for value in row):
            yield row
        elif self._wanted.missing == "unknown":
            # What was heard may be a violation already.
            yield [
                _nothing(read.signal) if value is None else value
                for read, value in zip(self._reads, row, strict=True)
            ]
        else:
            self._skipped += 1

    def _ticks(self) -> str:
        topic = self._wanted.ticks
        found = ", ".join(
            f"{name} ({plural(t.msgcount, 'message')})" for name, t in self._topics.items()
        )
        if topic is None:
            raise UsageError(
                f"--ticks names the topic whose messages are the policy's ticks; {self._path} has "
                f"{found or 'no messages'}."
            )
        if topic not in self._topics:
            raise UsageError(
                f"--ticks: {self._path} has no messages of '{topic}'; it has "
                f"{found or 'none'}.{did_you_mean(topic, self._topics)}"
            )
        return topic

    def _read(self, signal: Signal) -> _Read | None:
        given = self._wanted.columns.get(signal.name)
        column = given or f"/{signal.name}.data"
        topic, _, path = column.partition(".")
        steps = [_STEP.fullmatch(step) for step in path.split(".")]
        if None in steps:
            raise UsageError(
                f"--column: '{column}' is no field of a topic's messages, as in "
                f"{signal.name}=/odom.twist.twist.linear.x or /scan.ranges[3]."
            )
        if topic not in self._topics:
            used = signal.name in plan_of(self._wanted.task).signals
            if given is None and (self._wanted.missing == "unknown" or not used):
                return None
            raise TraceError(
                f"{self._path} has no messages of '{topic}' for signal '{signal.name}'; it has "
                f"{', '.join(self._topics)}.{did_you_mean(topic, self._topics)} Another column: "
                f"--column {signal.name}=/TOPIC.FIELD.{self._wanted.advice}"
            )
        root = None if signal.source is None else signal.source.root
        lag = {"action": 0, "last_action": 1}.get(root or "", 0)
        if root in ("action", "last_action") and topic == self.ticks:
            lag += 1
        names = [step[1] for step in steps if step]
        indices = [[int(i) for i in re.findall(r"\d+", step[2])] for step in steps if step]
        walk = partial(_walk, names=names, indices=indices, column=column, path=self._path)
        return _Read(signal, topic, column, walk, lag)

    def _checked(self, read: _Read, message: Any, stamp: int) -> Any:
        value = read.value(message)
        name, length = read.signal.name, read.signal.length
        try:
            number = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            entries = ", ".join(_fields(value))
            raise TraceError(
                f"{self._path}: '{read.column}' for signal '{name}' is a "
                f"{type(value).__name__.rsplit('__', 1)[-1]}, not a number."
                + (f" It has {entries}." if entries else "")
            ) from None
        if number.shape != (() if length is None else (length,)):
            found = plural(number.size, "component") if number.ndim else "one number"
            wanted = "one number" if length is None else plural(length, "component")
            raise TraceError(f"{self._path}: '{read.column}' is {found}, signal '{name}' {wanted}.")
        if self._wanted.missing == "error" and np.isnan(number).any():
            raise TraceError(f"{self._path}: '{read.column}' is NaN at {stamp / 1e9:.9f} s.")
        return number if length is not None else float(number)


def _nothing(signal: Signal) -> Any:
    """The value of a signal that was not heard yet."""
    return math.nan if signal.length is None else np.full(signal.length, math.nan)


def _walk(
    message: Any, *, names: list[str], indices: list[list[int]], column: str, path: Path
) -> Any:
    """The value of a field."""
    value = message
    for name, places in zip(names, indices, strict=True):
        if not hasattr(value, name):
            known = _fields(value)
            raise TraceError(
                f"{path}: '{column}' does not exist: there is no '{name}' among "
                f"{', '.join(known) or 'numbers'}.{did_you_mean(name, known)}"
            )
        value = getattr(value, name)
        for place in places:
            try:
                value = value[place]
            except (IndexError, TypeError):
                raise TraceError(f"{path}: '{column}' does not exist: no [{place}].") from None
    return value


def _fields(message: Any) -> list[str]:
    """Names of a message's fields."""
    known = getattr(message, "__dataclass_fields__", ())
    return [name for name in known if not name.startswith("__")]
