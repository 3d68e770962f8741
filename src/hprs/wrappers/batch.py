"""Reads the signals of a vector environment's states as arrays, and checks them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hprs.errors import SignalError
from hprs.semantics.plan import plan_of
from hprs.spec.task import Task
from hprs.wrappers.resets import Mask
from hprs.wrappers.signals import UNSUPPLIED, Reader


class BatchReader:
    """Reads states of all rows in double precision; counts rows outside their ranges.

    Args:
        task: The task whose ranges hold.
        reader: Reads its signals.
        count: How many rows (sub-environments) there are.
    """

    def __init__(self, task: Task, reader: Reader, count: int) -> None:
        self._reader = reader
        self._count = count
        self._names = plan_of(task).signals
        lengths = {s.name: () if s.length is None else (s.length,) for s in task.signals}
        self._shapes = {name: (count, *lengths[name]) for name in self._names}
        self._ranges = {name: task.ranges[name] for name in self._names}
        self._fillers = {
            name: min(max(0.0, ends.low), ends.high) for name, ends in self._ranges.items()
        }
        self._scalars = [name for name in self._names if name not in reader.vectors]
        rows = [self._names.index(name) for name in self._scalars]
        self._rows: Any = slice(None) if not reader.vectors else rows
        self._lows = np.array([[self._ranges[name].low] for name in self._scalars])
        self._highs = np.array([[self._ranges[name].high] for name in self._scalars])
        self._everyone: Mask = np.ones(count, bool)
        self._all_inside = np.ones((len(self._names), count), bool)
        self._outside = np.zeros((len(self._names), count), np.int64)

    def at_reset(
        self, observation: Any, zeros: Any, infos: dict[str, Any], mask: Mask
    ) -> dict[str, Any]:
        """The signals of s_0 in the rows of a mask, where counting starts anew.

        Raises:
            SignalError: One is missing, misshapen or NaN.
        """
        initial = {
            name: value
            for name, value in self._reader.initially.items()
            if not self._present(name, infos)[mask].all()
        }
        self._outside[:, mask] = 0
        values = self._read(observation, zeros, zeros, infos, initial, mask)
        self._check(values, mask, np.zeros(self._count, int))
        return values

    def after_step(
        self,
        observation: Any,
        actions: Any,
        last_actions: Any,
        infos: dict[str, Any],
        mask: Mask,
        steps: Any,
    ) -> dict[str, Any]:
        """The signals of the states reached; rows outside the mask may hold anything.

        Args:
            observation: A batch.
            actions: The actions that led here.
            last_actions: Those before.
            infos: Gymnasium's masked infos.
            mask: The rows that were stepped.
            steps: For each row the number of the step that reached it.

        Raises:
            SignalError: One is missing, misshapen or NaN.
        """
        values = self._read(observation, actions, last_actions, infos, {}, mask)
        self._check(values, mask, steps)
        return values

    def outside(self, row: Any) -> dict[str, int]:
        """Signal name to the number of states of a row's episode in which it left its range."""
        counts = zip(self._names, self._outside[:, row], strict=True)
        return {name: int(count) for name, count in counts if count}

    def _read(
        self,
        observation: Any,
        actions: Any,
        last_actions: Any,
        infos: dict[str, Any],
        initial: Mapping[str, Any],
        mask: Mask,
    ) -> dict[str, Any]:
        values: dict[str, Any] = {}
        given = self._reader.given(observation, actions, last_actions, infos)
        for name, read in self._reader.reads.items():
            if name in given:
                values[name] = self._numbers(name, given[name])
                continue
            present = self._present(name, infos)
            if name not in initial and not present[mask].all():
                row = int(np.flatnonzero(mask & ~present)[0])
                own = self._reader.only_by_function(name)
                reason = UNSUPPLIED if own else "its info does not supply it."
                raise SignalError(f"signal '{name}' is missing in sub-environment {row}: {reason}")
            value: Any = None
            if present.any():
                value = self._numbers(name, read(observation, actions, last_actions, infos))
            if not present.all():
                # In rows that supply nothing stands the initial value, or any value of the range.
                filler = np.broadcast_to(initial.get(name, self._fillers[name]), self._shapes[name])
                here = present if filler.ndim == 1 else present[:, None]
                value = filler if value is None else np.where(here, value, filler)
            values[name] = value
        return values

    def _present(self, name: str, infos: dict[str, Any]) -> Mask:
        present = getattr(self._reader.reads[name], "present", None)
        return self._everyone if present is None else present(infos, self._count)

    def _numbers(self, name: str, value: Any) -> Any:
        try:
            # A copy: an environment may reuse its buffers, and a reward may remember a signal.
            numbers = np.array(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise SignalError(
                f"signal '{name}' must be an array of numbers of shape {self._shapes[name]}, "
                f"got {value!r:.80}."
            ) from None
        if numbers.shape != self._shapes[name]:
            raise SignalError(
                f"signal '{name}' must have shape {self._shapes[name]}, one row a "
                f"sub-environment, got shape {numbers.shape}."
            )
        return numbers

    def _check(self, values: dict[str, Any], mask: Mask, steps: Any) -> None:
        """Count the rows of the mask in which a signal left its range; refuse NaN."""
        inside = self._all_inside.copy()
        if self._scalars:
            stacked = np.stack([values[name] for name in self._scalars])
            inside[self._rows] = (stacked >= self._lows) & (stacked <= self._highs)
        for name in self._reader.vectors:
            ends, value = self._ranges[name], values[name]
            row = self._names.index(name)
            inside[row] = ((value >= ends.low) & (value <= ends.high)).all(axis=-1)
        if inside.all():
            return
        outside = ~inside & mask
        for number in np.flatnonzero(outside.any(axis=1)):
            name = self._names[number]
            unknown = np.isnan(values[name]).reshape(self._count, -1).any(axis=1) & mask
            if unknown.any():
                row = int(np.flatnonzero(unknown)[0])
                raise SignalError(
                    f"signal '{name}' is NaN at step {int(steps[row])} of sub-environment {row}."
                )
        self._outside += outside
