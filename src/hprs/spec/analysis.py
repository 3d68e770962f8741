"""What can be known of a task without running it: shapes, ranges, bounds, and remarks.

Bounds are found by interval arithmetic, so they contain every margin that signals inside their
ranges can give, up to rounding. Only the lower bound l enters a score (the paper, section
"Hierarchical Potential-based Reward Shaping", which assumes l < 0 < u).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from hprs.errors import Position, SpecTypeError, SpecValidationError
from hprs.spec import interval
from hprs.spec.expression import And, Comparison, Expression, Name, Negate, Predicate
from hprs.spec.inference import Inferred, UnknownNameError, evaluate_constant, infer
from hprs.spec.interval import DomainError, Interval
from hprs.spec.lint import judge, judge_whole
from hprs.spec.misuse import shown
from hprs.spec.statements import Definition, Requirement, Signal
from hprs.spec.task import Remark, Task
from hprs.spec.traversal import comparisons
from hprs.spec.vocabulary import ENV_REWARD, RESERVED


class Analysis(NamedTuple):
    """Everything derived from a task's text."""

    known: Mapping[str, Inferred]
    """Every name of the task: constants, signals and definitions."""
    bounds: Mapping[str, Interval]
    """Label to the range [l, u] of the requirement's margin."""
    leaves: Mapping[str, tuple[Interval, ...]]
    """Label to the range [l, u] of each comparison of its predicate, from left to right."""
    remarks: tuple[Remark, ...]

    @property
    def ranges(self) -> Mapping[str, Interval]:
        """Every name of the task to its range."""
        return {name: inferred.range for name, inferred in self.known.items()}


def analyse(task: Task) -> Analysis:
    """Check a task and derive its bounds.

    Raises:
        SpecValidationError: The task cannot be meant; see `Task`.
    """
    known = _declare(task)
    _check_labels(task, known)
    remarks: list[Remark] = []
    bounds: dict[str, Interval] = {}
    ranges: dict[str, tuple[Interval, ...]] = {}
    for requirement in task.requirements:
        leaves = tuple(
            _comparison(leaf, requirement, known) for leaf in comparisons(requirement.predicate)
        )
        bounds[requirement.label] = _bound(requirement.predicate, iter(leaves).__next__)
        ranges[requirement.label] = leaves
        remarks += judge(requirement, leaves, bounds[requirement.label], known)
    remarks += judge_whole(task)
    return Analysis(known, bounds, ranges, tuple(remarks))


def _declare(task: Task) -> dict[str, Inferred]:
    known: dict[str, Inferred] = {}
    later = {d.name for d in (*task.constants, *task.signals, *task.definitions)}
    for constant in task.constants:
        _check_name(constant.name, known, constant.position)
        with _Later(later):
            value = evaluate_constant(constant.value, known, f"const '{constant.name}'")
        known[constant.name] = Inferred(interval.point(value), constant=True)
    for signal in task.signals:
        _check_name(signal.name, known, signal.position)
        with _Later(later):
            known[signal.name] = _signal(signal, known)
    for definition in task.definitions:
        _check_name(definition.name, known, definition.position)
        with _Later(later):
            known[definition.name] = _definition(definition, known)
    return known


class _Later:
    """Turns "unknown name" into "used before its declaration" where that is the reason."""

    def __init__(self, later: set[str]) -> None:
        self._later = later

    def __enter__(self) -> None:
        """Nothing to prepare."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Replace the message of an unknown name that is declared later."""
        if isinstance(error, UnknownNameError) and error.name in self._later:
            raise SpecValidationError(
                f"'{error.name}' is used before its declaration. Order the task: constants, "
                "signals, definitions, requirements.",
                error.position,
            ) from None


def _check_name(name: str, taken: Mapping[str, object], position: Position | None) -> None:
    if not isinstance(name, str):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise SpecTypeError(f"a name is a text, got {shown(name)}.", position)
    if name == ENV_REWARD:
        raise SpecValidationError(
            f"'{name}' is reserved for the environment's own reward.", position
        )
    if name in RESERVED:
        raise SpecValidationError(f"'{name}' is a reserved word; choose another name.", position)
    if not (name.isidentifier() and name.isascii()):
        raise SpecValidationError(
            f"'{name}' is not a name: use letters, digits and underscores, not a digit first.",
            position,
        )
    if name in taken:
        raise SpecValidationError(
            f"'{name}' is declared twice; signals, constants, definitions and requirements "
            "share one namespace.",
            position,
        )


def _check_labels(task: Task, known: Mapping[str, Inferred]) -> None:
    taken: dict[str, object] = dict(known)
    for requirement in task.requirements:
        _check_name(requirement.label, taken, requirement.position)
        taken[requirement.label] = requirement


def _signal(signal: Signal, known: Mapping[str, Inferred]) -> Inferred:
    what = f"signal '{signal.name}'"
    low = _end(signal.low, known, f"the range of {what}")
    high = _end(signal.high, known, f"the range of {what}")
    if not low < high:
        raise SpecValidationError(
            f"{what} needs low < high, got [{low:g}, {high:g}].", signal.position
        )
    if signal.initially is not None:
        value = evaluate_constant(signal.initially, known, f"the initial value of {what}")
        if not low <= value <= high:
            raise SpecValidationError(
                f"{what} starts at {value:g}, outside its range [{low:g}, {high:g}].",
                signal.position,
            )
    index = None if signal.source is None else signal.source.index
    if signal.length is None and isinstance(index, tuple):
        raise SpecValidationError(
            f"{what} reads a slice: give it a length, as in signal {signal.name}[3].",
            signal.position,
        )
    if signal.length is not None and isinstance(index, int):
        raise SpecValidationError(
            f"{what} has length {signal.length} and reads one component; use a slice.",
            signal.position,
        )
    return Inferred(Interval(low, high), signal.length)


def _definition(definition: Definition, known: Mapping[str, Inferred]) -> Inferred:
    what = f"the range of '{definition.name}'"
    inferred = infer(definition.value, known)
    if definition.low is None or definition.high is None:
        return inferred
    low, high = _end(definition.low, known, what), _end(definition.high, known, what)
    if not low < high:
        raise SpecValidationError(
            f"{what} needs low < high, got [{low:g}, {high:g}].", definition.position
        )
    try:
        tightened = inferred.range.meet(Interval(low, high))
    except DomainError:
        raise SpecValidationError(
            f"{what} [{low:g}, {high:g}] does not meet what its expression can be: "
            f"{inferred.range}.",
            definition.position,
        ) from None
    return Inferred(tightened, inferred.length, inferred.constant)


def _end(expression: Expression, known: Mapping[str, Inferred], what: str) -> float:
    """One end of a range: a constant expression, or plus or minus infinity."""
    match expression:
        case Name("inf"):
            return math.inf
        case Negate(Name("inf")):
            return -math.inf
        case _:
            return evaluate_constant(expression, known, what)


def _comparison(
    comparison: Comparison, requirement: Requirement, known: Mapping[str, Inferred]
) -> Interval:
    inferred = infer(comparison.margin, known)
    if inferred.length is not None:
        raise SpecValidationError(
            f"requirement '{requirement.label}' compares a vector of {inferred.length}; reduce it "
            "with min, max, sum, mean or norm.",
            comparison.position or requirement.position,
        )
    return inferred.range


def _bound(predicate: Predicate, next_leaf: Callable[[], Interval]) -> Interval:
    if isinstance(predicate, Comparison):
        return next_leaf()
    parts = [_bound(part, next_leaf) for part in predicate.parts]
    return interval.minimum(parts) if isinstance(predicate, And) else interval.maximum(parts)
