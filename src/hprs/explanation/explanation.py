"""What is to be said of an episode, requirement by requirement, as data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hprs.errors import TraceError
from hprs.semantics.assessment import Assessment, assess
from hprs.semantics.contributions import evaluated_contributions
from hprs.semantics.evaluation import Signals, evaluate_arrays
from hprs.semantics.plan import plan_of
from hprs.semantics.trace import check_trace, refuse_nan
from hprs.spec.printer import format_predicate
from hprs.spec.task import Requirement, Task, require_task

LONGEST = 2_000_000
"""States of an episode that is explained, at most."""

Numbers: TypeAlias = npt.NDArray[np.float64]
Truths: TypeAlias = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Part:
    """One requirement over an episode; arrays have one entry a state, s_0 first."""

    requirement: Requirement
    low: float
    """Lower bound l of the margin."""
    high: float
    """Upper bound u of the margin."""
    margins: Numbers
    scores: Numbers
    contributions: Numbers
    """The requirement's term of the potential."""
    satisfied: Truths

    @property
    def label(self) -> str:
        """The requirement's label."""
        return self.requirement.label

    @property
    def name(self) -> str:
        """Kind and label, as tables show them."""
        return f"{self.requirement.kind} {self.requirement.label}"

    @property
    def predicate(self) -> str:
        """Where the requirement holds, as text."""
        return format_predicate(self.requirement.predicate)

    @property
    def is_target(self) -> bool:
        """Whether it is to be reached: where it does not hold, it is not met yet."""
        return self.requirement.requirement_class == "target"

    @cached_property
    def changes(self) -> Numbers:
        """How the contribution changed with the step into each state; 0 in s_0."""
        return changes(self.contributions)

    @property
    def earned(self) -> float:
        """Sum of the changes for the better."""
        return float(self.changes[self.changes > 0.0].sum())

    @property
    def cost(self) -> float:
        """Sum of the changes for the worse, not positive."""
        return float(self.changes[self.changes < 0.0].sum())

    @property
    def fraction(self) -> float:
        """Fraction of the steps, s_0 left out, after which it held."""
        return float(np.mean(self.satisfied[1:]))

    @property
    def worst(self) -> float:
        """Lowest margin."""
        return float(self.margins.min())

    @property
    def first_violation(self) -> int | None:
        """The first state in which it does not hold; None for targets, and where there is none."""
        return None if self.is_target else first(~self.satisfied)

    @property
    def met_from(self) -> int | None:
        """From which state on a target counts as met; None if never, or if it is no target."""
        if self.requirement.kind == "achieve":
            return first(self.satisfied)
        if self.requirement.kind == "conquer" and self.satisfied[-1]:
            lost = np.flatnonzero(~self.satisfied)
            return int(lost[-1]) + 1 if len(lost) else 0
        return None


@dataclass(frozen=True, eq=False)
class Explanation:
    """An episode, explained."""

    title: str
    """What was recorded."""
    task: Task
    parts: tuple[Part, ...]
    """Every requirement: safety, then the target, then comfort."""
    potential: Numbers
    """Psi of every state."""
    assessment: Assessment
    rate: float | None = None
    """Steps a second, where known."""
    notes: tuple[str, ...] = ()
    """What was unusual about the recording."""

    @property
    def steps(self) -> int:
        """Number of steps; there is one more state."""
        return len(self.potential) - 1

    @cached_property
    def shaping(self) -> Numbers:
        """The `"paper"` convention's shaping of the step into each state; 0 in s_0."""
        return changes(self.potential)

    @cached_property
    def base(self) -> Numbers:
        """The base reward of the step into each state: 1 where the target holds; 0 in s_0."""
        held = [part.satisfied for part in self.parts if part.is_target]
        base = held[0].astype(np.float64) if held else np.zeros(self.steps + 1)
        base[0] = 0.0
        return base

    def first_violation(self, requirement_class: str) -> Part | None:
        """The requirement of a class that is violated first, if one is."""
        violated = [
            part
            for part in self.parts
            if part.requirement.requirement_class == requirement_class
            and part.first_violation is not None
        ]
        return min(violated, key=lambda part: part.first_violation or 0, default=None)

    def moment(self, step: int) -> str:
        """A step in words, with its time where the rate is known."""
        return f"step {step:,}{self.after(step)}"

    def after(self, step: int) -> str:
        """The time of a step in parentheses, where the rate is known."""
        return f" ({step / self.rate:.2f} s)" if self.rate else ""


def explain(
    task: Task,
    trace: Signals,
    *,
    title: str = "",
    rate: float | None = None,
    notes: Sequence[str] = (),
) -> Explanation:
    """Explain a recorded episode.

    Args:
        task: The task.
        trace: Signal name to values over time, s_0 first.
        title: What was recorded.
        rate: Steps a second, where known.
        notes: What was unusual about the recording.

    Raises:
        TraceError: The trace cannot be assessed (see `hprs.assess`), is a batch, is longer than
            `LONGEST`, or has a margin that is NaN.
    """
    plan = plan_of(require_task(task))
    values = {name: np.asarray(value) for name, value in check_trace(plan, trace).items()}
    vectors = {signal.name for signal in task.signals if signal.length is not None}
    states = len(next(iter(values.values())))
    if any(value.ndim != 1 + (name in vectors) for name, value in values.items()):
        raise TraceError("a batch of episodes cannot be explained; give one of them.")
    if states > LONGEST:
        raise TraceError(_too_long(f"{states:,}"))
    with np.errstate(all="ignore"):
        evaluation = evaluate_arrays(plan, values, np)
    refuse_nan(plan, evaluation.margins)
    terms = evaluated_contributions(task, evaluation)
    parts = tuple(
        Part(
            requirement,
            *task.bounds[requirement.label],
            margins=evaluation.margins[row],
            scores=evaluation.scores[row],
            contributions=np.asarray(terms[row]),
            satisfied=evaluation.satisfied[row],
        )
        for row, requirement in enumerate(plan.rows)
    )
    potential = np.asarray(evaluation.potential)
    return Explanation(title, task, parts, potential, assess(task, trace), rate, tuple(notes))


def joined(chunks: Iterable[Signals]) -> dict[str, Any]:
    """A trace of its pieces, one after the other.

    Raises:
        TraceError: It is longer than `LONGEST`.
    """
    pieces: list[Signals] = []
    states = 0
    for chunk in chunks:
        pieces.append(chunk)
        states += len(next(iter(chunk.values()), ()))
        if states > LONGEST:
            raise TraceError(_too_long(f"more than {LONGEST:,}"))
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}


def _too_long(states: str) -> str:
    return f"an episode of {states} states is too long to explain; cut it to {LONGEST:,}."


def changes(values: Numbers) -> Numbers:
    """Differences to the state before; 0 in s_0."""
    return np.diff(values, prepend=values[:1])


def first(holds: Truths) -> int | None:
    """The first state in which something holds."""
    return int(np.argmax(holds)) if holds.any() else None
