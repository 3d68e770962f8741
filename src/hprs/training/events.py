"""Writes TensorBoard's files, whatever the trainer: TensorBoard's own package suffices."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import Any

from hprs.semantics.assessment import Summary
from hprs.training.environment import require
from hprs.training.run_directory import RunDirectory


class EventWriter:
    """One file of numbers for TensorBoard.

    It writes at once and without a thread of its own, so that a full disk is an error where it
    happens.

    Args:
        run: Where the file is made.
        step: The step that the training goes on from: what was written of later ones is void.

    Raises:
        RunError: The file cannot be made.
    """

    def __init__(self, run: RunDirectory, step: int = 0) -> None:
        # Generated modules, of which no type is known.
        self._event = require("tensorboard.compat.proto.event_pb2", "jax")
        self._summary = require("tensorboard.compat.proto.summary_pb2", "jax").Summary
        records = require("tensorboard.summary.writer.record_writer", "jax")
        self._run = run
        path = run.path / f"events.out.tfevents.{time.time_ns()}"
        with run.writing():
            self._file = path.open("xb")
        self._records = records.RecordWriter(self._file)
        self._append(file_version="brain.Event:2")
        if step:
            started = self._event.SessionLog(status=self._event.SessionLog.START)
            self._append(step=step + 1, session_log=started)

    def write(self, scalars: Mapping[str, float], step: int) -> None:
        """Add numbers.

        Args:
            scalars: Name to number.
            step: The step that they belong to.

        Raises:
            RunError: They cannot be written.
        """
        values = [
            self._summary.Value(tag=name, simple_value=value) for name, value in scalars.items()
        ]
        self._append(step=step, summary=self._summary(value=values))

    def close(self) -> None:
        """Close the file."""
        with self._run.writing():
            self._file.close()

    def __enter__(self) -> EventWriter:
        """The writer itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file."""
        self.close()

    def _append(self, **fields: Any) -> None:
        record = self._event.Event(wall_time=time.time(), **fields)
        with self._run.writing():
            self._records.write(record.SerializeToString())
            self._file.flush()


def assessment_scalars(summary: Summary) -> dict[str, float]:
    """What is told of an evaluation, by the names of events."""
    return {
        "assessment/PAM": summary.pam,
        "assessment/S": summary.safe,
        "assessment/S+T": summary.safe_target,
        "assessment/S+T+C": summary.safe_target_comfort,
        **{f"requirement/{label}": value for label, value in summary.requirements.items()},
    }
