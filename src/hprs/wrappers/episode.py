"""Follows one episode of one environment: when the task decides it, and its assessment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hprs.semantics import assessment
from hprs.semantics.plan import Plan

_CHUNK = 64


class Episode:
    """The tally of a running episode, advanced some dozens of steps at a time.

    A tally that advances every step costs three times as much, because everything else that runs
    in between pushes it out of the processor's caches. Memory stays bounded.

    Args:
        plan: The task's plan.
        end_on_violation: A violated safety requirement decides the episode.
        end_on_target: A target that was to be achieved, and is met, decides the episode.
    """

    def __init__(self, plan: Plan, *, end_on_violation: bool, end_on_target: bool) -> None:
        self._plan = plan
        self._safety_count = plan.safety_count
        self._end_on_violation = end_on_violation and plan.safety_count > 0
        self._end_on_target = end_on_target and plan.achieves
        self._tally: Any = None
        self._pending: list[list[bool]] = []
        self._decided = False
        self.steps = -1
        """Steps of the running episode; -1 before the first."""

    def start(self, satisfied: list[bool]) -> None:
        """Begin an episode with the satisfaction of every row in s_0."""
        self._tally = assessment.start(self._plan, satisfied)
        self._pending.clear()
        self._decided = False
        self.add(satisfied)
        self._pending.clear()
        self.steps = 0

    def add(self, satisfied: list[bool]) -> bool:
        """Add a step; whether the task has decided the episode."""
        self.steps += 1
        pending = self._pending
        pending.append(satisfied)
        if len(pending) == _CHUNK:
            self._fold()
        if self._end_on_violation and False in satisfied[: self._safety_count]:
            self._decided = True
        if self._end_on_target and satisfied[self._safety_count]:
            self._decided = True
        return self._decided

    def conclude(self, outside: Mapping[str, int]) -> assessment.Assessment:
        """The assessment of the episode so far."""
        return assessment.conclude(self._plan, self._fold(), outside=outside)

    def _fold(self) -> Any:
        if self._pending:
            self._tally = assessment.advance_many(self._plan, self._tally, self._pending)
            self._pending = []
        return self._tally
