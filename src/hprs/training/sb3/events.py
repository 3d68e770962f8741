"""Writes TensorBoard's files."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from hprs.training.environment import require
from hprs.training.run_directory import RunDirectory


def make_logger(run: RunDirectory, step: int) -> Any:
    """A logger of Stable-Baselines3 that writes numbers for TensorBoard.

    It writes at once and without a thread of its own, so that a full disk is an error where it
    happens.

    Args:
        run: Where the file is made.
        step: The step that the training goes on from: what was written of later ones is void.
    """
    from stable_baselines3.common.logger import KVWriter, Logger
    from tensorboard.summary.writer.record_writer import RecordWriter

    # Generated modules, of which no type is known.
    event = require("tensorboard.compat.proto.event_pb2", "sb3")
    Summary = require("tensorboard.compat.proto.summary_pb2", "sb3").Summary  # noqa: N806

    class Events(KVWriter):
        """One file of events."""

        def __init__(self) -> None:
            path = run.path / f"events.out.tfevents.{time.time_ns()}"
            with run.writing():
                self._file = path.open("xb")
            self._records = RecordWriter(self._file)
            self._write(event.Event(wall_time=time.time(), file_version="brain.Event:2"))
            if step:
                started = event.SessionLog(status=event.SessionLog.START)
                self._write(event.Event(wall_time=time.time(), step=step + 1, session_log=started))

        def write(
            self,
            key_values: dict[str, Any],
            key_excluded: dict[str, tuple[str, ...]],
            step: int = 0,
        ) -> None:
            values = [
                Summary.Value(tag=key, simple_value=float(value))
                for key, value in key_values.items()
                if isinstance(value, int | float | np.number)
                and "tensorboard" not in (key_excluded.get(key) or ())
            ]
            summary = Summary(value=values)
            self._write(event.Event(wall_time=time.time(), step=step, summary=summary))

        def close(self) -> None:
            with run.writing():
                self._file.close()

        def _write(self, record: Any) -> None:
            with run.writing():
                self._records.write(record.SerializeToString())
                self._file.flush()

    return Logger(folder=str(run.path), output_formats=[Events()])
