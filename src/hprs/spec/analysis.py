"""What can be known of a task without running it: shapes, ranges, bounds, and remarks.

Bounds are found by interval arithmetic, so they contain every margin that signals inside their
ranges can give, up to rounding. Only the lower bound l enters a score (the paper, section
"Hierarchical Potential-based Reward Shaping", which assumes l < 0 < u).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from hprs.errors import Position, SpecValidationError, did_you_mean
from hprs.spec import interval
from hprs.spec.expression import (
    BUILTIN_CONSTANTS,
    REDUCTIONS,
    And,
    Binary,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    Predicate,
    comparisons,
    names,
)
from hprs.spec.interval import DomainError, Interval
from hprs.spec.task import ENV_REWARD, RESERVED, Definition, Remark, Requirement, Signal, Task


@dataclass(frozen=True)
class Inferred:
    """What is known of an expression: its range, its length (None: scalar), if it is constant."""

    range: Interval
    length: int | None = None
    constant: bool = False


@dataclass(frozen=True)
class Analysis:
    """Everything derived from a task's text."""

    known: Mapping[str, Inferred]
    """Every name of the task: constants, signals and definitions."""
    bounds: Mapping[str, Interval]
    """Label to the range [l, u] of the requirement's margin."""
    lows: Mapping[str, tuple[float, ...]]
    """Label to the lower bound l of each comparison of its predicate, from left to right."""
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
    lows: dict[str, tuple[float, ...]] = {}
    for requirement in task.requirements:
        leaves = [
            _comparison(leaf, requirement, known) for leaf in comparisons(requirement.predicate)
        ]
        bounds[requirement.label] = _bound(requirement.predicate, iter(leaves).__next__)
        lows[requirement.label] = tuple(leaf.low for leaf in leaves)
        remarks += _judge(requirement, leaves, bounds[requirement.label], known)
    remarks += _judge_whole(task)
    return Analysis(known, bounds, lows, tuple(remarks))


def infer(expression: Expression, known: Mapping[str, Inferred]) -> Inferred:
    """Range, length and constancy of an expression over known names.

    Raises:
        SpecValidationError: A name is unknown, lengths differ or an operation is undefined
            somewhere in its arguments' ranges.
    """
    match expression:
        case Number(value):
            return Inferred(interval.point(value), constant=True)
        case Name(name):
            return _look_up(name, known, expression.position)
        case Negate(operand):
            part = infer(operand, known)
            return Inferred(interval.negate(part.range), part.length, part.constant)
        case Binary(operator, left, right):
            parts = (infer(left, known), infer(right, known))
            operation = _BINARY[operator]
            if operator == "*" and left == right:
                operation = _square
            return _apply(expression, parts, lambda: operation(parts[0].range, parts[1].range))
        case _:
            parts = tuple(infer(argument, known) for argument in expression.arguments)
            if expression.function in REDUCTIONS:
                return _reduce(expression, parts)
            function = _FUNCTIONS[expression.function]
            return _apply(expression, parts, lambda: function(*(part.range for part in parts)))


def evaluate_constant(expression: Expression, known: Mapping[str, Inferred], what: str) -> float:
    """The value of a constant expression.

    Raises:
        SpecValidationError: It refers to a signal, or is too large for a float.
    """
    inferred = infer(expression, known)
    if not inferred.constant:
        raise SpecValidationError(
            f"{what} must be a constant expression, but it depends on a signal.",
            expression.position,
        )
    return inferred.range.low


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
        if isinstance(error, _UnknownNameError) and error.name in self._later:
            raise SpecValidationError(
                f"'{error.name}' is used before its declaration. Order the task: constants, "
                "signals, definitions, requirements.",
                error.position,
            ) from None


class _UnknownNameError(SpecValidationError):
    name: str = ""


def _unknown(
    name: str, known: Mapping[str, Inferred], position: Position | None
) -> _UnknownNameError:
    advice = did_you_mean(name, (*known, *BUILTIN_CONSTANTS))
    error = _UnknownNameError(f"unknown name '{name}'.{advice}", position)
    error.name = name
    return error


def _check_name(name: str, taken: Mapping[str, object], position: Position | None) -> None:
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


def _look_up(name: str, known: Mapping[str, Inferred], position: Position | None) -> Inferred:
    if name == "inf":
        raise SpecValidationError("inf may stand only at the end of a range.", position)
    if name in BUILTIN_CONSTANTS:
        return Inferred(interval.point(BUILTIN_CONSTANTS[name]), constant=True)
    if name not in known:
        raise _unknown(name, known, position)
    return known[name]


def _apply(
    node: Binary | Call, parts: Sequence[Inferred], operation: Callable[[], Interval]
) -> Inferred:
    lengths = {part.length for part in parts} - {None}
    if len(lengths) > 1:
        listed = " and ".join(str(length) for length in sorted(lengths, key=str))
        raise SpecValidationError(f"vectors of lengths {listed} do not match.", node.position)
    constant = all(part.constant for part in parts)
    return Inferred(_defined(node, operation), next(iter(lengths), None), constant)


def _reduce(node: Call, parts: Sequence[Inferred]) -> Inferred:
    vectors = [part for part in parts if part.length is not None]
    if vectors and len(parts) > 1:
        raise SpecValidationError(
            f"{node.function}() reduces one vector or compares several scalars, not a mix of them.",
            node.position,
        )
    if vectors:
        length = vectors[0].length or 1
        reduced = _defined(node, lambda: _reduced(node.function, parts[0].range, length))
    else:
        ranges = [part.range for part in parts]
        reduced = _defined(node, lambda: _REDUCTIONS[node.function](ranges))
    return Inferred(reduced, None, all(part.constant for part in parts))


def _reduced(function: str, x: Interval, length: int) -> Interval:
    """Range of a reduction of a vector whose components lie in `x`."""
    if function == "sum":
        return interval.multiply(x, interval.point(float(length)))
    if function == "norm":
        return interval.multiply(interval.absolute(x), interval.point(math.sqrt(length)))
    return x


def _defined(node: Binary | Call, operation: Callable[[], Interval]) -> Interval:
    try:
        return operation()
    except DomainError as error:
        raise SpecValidationError(
            f"{error}. Bound it with max(), clip() or `let`.", node.position
        ) from None


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


def _never(leaf: Interval, comparison: Comparison) -> bool:
    return leaf.high < 0.0 or (leaf.high == 0.0 and comparison.strict)


def _always(leaf: Interval, comparison: Comparison) -> bool:
    return leaf.low > 0.0 or (leaf.low == 0.0 and not comparison.strict)


def _verdict(
    predicate: Predicate,
    next_leaf: Callable[[], Interval],
    judge: Callable[[Interval, Comparison], bool],
    through_all: type[Predicate],
) -> bool:
    """Whether a verdict on comparisons carries to the predicate: all parts of one connective."""
    if isinstance(predicate, Comparison):
        return judge(next_leaf(), predicate)
    parts = [_verdict(part, next_leaf, judge, through_all) for part in predicate.parts]
    return all(parts) if isinstance(predicate, through_all) else any(parts)


def _judge(
    requirement: Requirement,
    leaves: Sequence[Interval],
    bound: Interval,
    known: Mapping[str, Inferred],
) -> list[Remark]:
    from hprs.spec.expression import Or

    label, predicate, where = requirement.label, requirement.predicate, requirement.position
    if _verdict(predicate, iter(leaves).__next__, _never, Or):
        raise SpecValidationError(
            f"requirement '{label}' can never be satisfied: its margin lies in {bound}."
            + _threshold(predicate, known),
            where,
        )
    remarks: list[Remark] = []
    if _verdict(predicate, iter(leaves).__next__, _always, And):
        remarks.append(
            Remark(
                f"requirement '{label}' is always satisfied (its margin lies in {bound}, its score "
                f"is 1); drop it or change its threshold.{_threshold(predicate, known)}",
                position=where,
            )
        )
    elif len(leaves) > 1:
        remarks += _judge_parts(requirement, leaves)
    if bound.high == 0.0:
        remarks.append(
            Remark(
                f"the margin of requirement '{label}' never exceeds 0, so its robustness cannot "
                "be positive; consider a tolerance.",
                position=where,
            )
        )
    if requirement.requirement_class != "safety":
        _check_finite(requirement, leaves)
    return remarks


def _judge_parts(requirement: Requirement, leaves: Sequence[Interval]) -> list[Remark]:
    remarks: list[Remark] = []
    for leaf, comparison in zip(leaves, comparisons(requirement.predicate), strict=True):
        for judge, verdict in ((_never, "never"), (_always, "always")):
            if judge(leaf, comparison):
                remarks.append(
                    Remark(
                        f"a comparison in requirement '{requirement.label}' is {verdict} "
                        f"satisfied: its margin lies in {leaf}.",
                        position=comparison.position or requirement.position,
                    )
                )
    return remarks


def _check_finite(requirement: Requirement, leaves: Sequence[Interval]) -> None:
    for leaf, comparison in zip(leaves, comparisons(requirement.predicate), strict=True):
        if math.isinf(leaf.low):
            raise SpecValidationError(
                f"requirement '{requirement.label}' needs a finite lower bound for its continuous "
                "score, but its margin has none. Give its signals finite ranges, use clip(), or "
                "name the expression with `let NAME = ... in [LOW, HIGH]`.",
                comparison.position or requirement.position,
            )


def _threshold(predicate: Predicate, known: Mapping[str, Inferred]) -> str:
    """Says which constant side of a single comparison lies outside the other side's range."""
    if not isinstance(predicate, Comparison):
        return ""
    left, right = infer(predicate.left, known), infer(predicate.right, known)
    if left.constant == right.constant:
        return ""
    threshold, other = (left.range, right.range) if left.constant else (right.range, left.range)
    if threshold.low in other:
        return ""
    return f" The threshold {threshold.low:g} is outside the range {other}."


def _judge_whole(task: Task) -> list[Remark]:
    targets = [r for r in task.requirements if r.requirement_class == "target"]
    if len(targets) > 1:
        first, second = targets[0].label, targets[1].label
        raise SpecValidationError(
            f"a task has one target, but '{first}' and '{second}' are two. "
            "Join their conditions with `and`.",
            targets[1].position,
        )
    remarks: list[Remark] = []
    if not targets:
        remarks.append(
            Remark(
                "the task has no target (achieve or conquer): the base reward is always 0 and the "
                "target counts as met."
            )
        )
    used = frozenset[str]().union(
        *(names(r.predicate) for r in task.requirements),
        *(names(d.value) for d in task.definitions),
    )
    for signal in task.signals:
        if signal.name not in used:
            remarks.append(
                Remark(f"signal '{signal.name}' is never used.", position=signal.position)
            )
    return remarks


def _square(x: Interval, _: Interval) -> Interval:
    return interval.square(x)


def _hypot(x: Interval, y: Interval) -> Interval:
    return interval.norm((x, y))


_BINARY: Mapping[str, Callable[[Interval, Interval], Interval]] = {
    "+": interval.add,
    "-": interval.subtract,
    "*": interval.multiply,
    "/": interval.divide,
    "**": interval.power,
}
_FUNCTIONS: Mapping[str, Callable[..., Interval]] = {
    "abs": interval.absolute,
    "clip": interval.clip,
    "sqrt": interval.square_root,
    "exp": interval.exponential,
    "log": interval.logarithm,
    "sin": interval.sine,
    "cos": interval.cosine,
    "tan": interval.tangent,
    "atan2": interval.arctangent,
    "hypot": _hypot,
    "sign": interval.sign,
}
_REDUCTIONS: Mapping[str, Callable[[Sequence[Interval]], Interval]] = {
    "min": interval.minimum,
    "max": interval.maximum,
    "sum": interval.total,
    "mean": interval.mean,
    "norm": interval.norm,
}
