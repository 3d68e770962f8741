"""Reads the signals of one environment's states as floats, and checks them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hprs.errors import SignalError
from hprs.semantics.evaluation import EVALUATION
from hprs.spec.task import ENV_REWARD, Task
from hprs.wrappers.signals import Reader


class StateReader:
    """Reads states: makes signals floats (vectors: copies), counts those outside their ranges.

    Args:
        task: The task whose ranges hold.
        reader: Reads its signals.
    """

    def __init__(self, task: Task, reader: Reader) -> None:
        self._reader = reader
        self._vectors = {s.name: s.length for s in task.signals if s.length is not None}
        ranges = task.ranges
        self._ranges = [(name, ranges[name].low, ranges[name].high) for name in reader.reads]
        self._quick = reader.quick
        self._blank: dict[str, Any] = dict.fromkeys([*reader.reads, ENV_REWARD, EVALUATION])
        self.outside: dict[str, int] = {}
        """Signal name to the number of states of the episode in which it left its range."""

    def at_reset(self, observation: Any, action: Any, info: Mapping[str, Any]) -> dict[str, Any]:
        """The signals of s_0; starts counting anew.

        Raises:
            SignalError: One is missing, misshapen or NaN.
        """
        self.outside = {}
        return self._check(self._reader.at_reset(observation, action, info), 0)

    def after_step(
        self, observation: Any, action: Any, last_action: Any, info: Mapping[str, Any], step: int
    ) -> dict[str, Any]:
        """The signals of the state that step number `step` reached.

        Raises:
            SignalError: One is missing, misshapen or NaN.
        """
        if self._quick is None:
            return self._check(self._reader(observation, action, last_action, info), step)
        # A copy of a dictionary with room for all that a step adds, which never has to grow.
        values = self._blank.copy()
        picked = self._quick(observation.tolist())
        # One value a range by construction; `strict` costs time every step.
        for (name, low, high), value in zip(self._ranges, picked):  # noqa: B905
            values[name] = value
            if not low <= value <= high:
                self._count(name, value, step)
        return values

    def _check(self, values: dict[str, Any], step: int) -> dict[str, Any]:
        for name, low, high in self._ranges:
            value = values[name] = self._converted(name, values[name])
            inside = (value >= low) & (value <= high)
            if not (inside if type(inside) is bool else inside.all()):
                self._count(name, value, step)
        return values

    def _converted(self, name: str, value: Any) -> Any:
        if type(value) is float and name not in self._vectors:
            return value
        length = self._vectors.get(name)
        try:
            # NumPy would make None NaN.
            array = np.array("None" if value is None else value, dtype=float)
        except (TypeError, ValueError):
            raise SignalError(
                f"signal '{name}' must be {_wanted(length)}, got {value!r:.80}."
            ) from None
        if array.shape != (() if length is None else (length,)):
            found = f"an array of shape {array.shape}" if array.shape else "one number"
            raise SignalError(f"signal '{name}' must be {_wanted(length)}, got {found}.")
        return float(array) if length is None else array

    def _count(self, name: str, value: Any, step: int) -> None:
        if np.isnan(value).any():
            raise SignalError(f"signal '{name}' is NaN at step {step}.")
        self.outside[name] = self.outside.get(name, 0) + 1


def _wanted(length: int | None) -> str:
    return "one number" if length is None else f"{length} numbers"
