"""When a training was how far: read from the times in its TensorBoard files.

Only the first two fields of each record are looked at, since a study has millions of them.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hprs.training import files

PATTERN = "events.out.tfevents.*"
_LENGTH, _CHECKSUM = 8, 4
"""Bytes before a record that say its length, and bytes of a checksum after them and after it."""
_TIME, _STEP = b"\x09", b"\x10"
"""Tags of an event's first two fields: the time as a double, the step as a varint."""


def seconds_of(folder: Path, steps: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Seconds of training up to some steps; the time between an interruption and going on is out.

    Args:
        folder: The run's.
        steps: (k,) of evaluations, increasing.

    Returns:
        (k,) seconds; NaN if no times are recorded.
    """
    known_steps, known_seconds = [0.0], [0.0]
    # Their names end in the time at which they were begun.
    for file in sorted(folder.glob(PATTERN)):
        times = list(_times(files.read(file)))
        first = next((step for step, _ in times if step), None)
        if first is None:
            continue
        began = times[0][1]
        # What an earlier file holds of later steps was made again.
        while known_steps[-1] >= first:
            known_steps.pop()
            known_seconds.pop()
        before = known_seconds[-1]
        for step, time in times:
            if step >= known_steps[-1]:
                known_steps.append(float(step))
                known_seconds.append(before + time - began)
    if len(known_steps) == 1:
        return np.full(np.shape(steps), np.nan)
    # Of several events of a step the last one: an evaluation is written when it is over.
    kept = np.append(np.diff(known_steps) > 0, True)
    return np.interp(steps, np.array(known_steps)[kept], np.array(known_seconds)[kept])


def _times(data: bytes) -> Iterator[tuple[int, float]]:
    """Step and time of each record, up to one that was cut off."""
    place = 0
    while place + _LENGTH + _CHECKSUM <= len(data):
        (length,) = struct.unpack_from("<Q", data, place)
        begin = place + _LENGTH + _CHECKSUM
        place = begin + length + _CHECKSUM
        if place > len(data):
            return
        if data[begin : begin + 1] == _TIME:
            (time,) = struct.unpack_from("<d", data, begin + 1)
            yield _step(data, begin + 9), time


def _step(data: bytes, place: int) -> int:
    """The step of an event, which is left out where it is 0."""
    if data[place : place + 1] != _STEP:
        return 0
    value = shift = 0
    for byte in data[place + 1 : place + 11]:
        value |= (byte & 0x7F) << shift
        shift += 7
        if not byte & 0x80:
            break
    return value
