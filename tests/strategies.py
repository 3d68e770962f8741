"""Hypothesis strategies: random valid tasks, and signals inside their ranges.

`tasks()` draws a task that `Task` accepts: vectors, constants, definitions, sources, units, nested
`and` / `or`, preferences, and infinite ranges where no continuous score needs a finite one.
`signals_for(task, batch_shape)` draws arrays for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from hprs.errors import SpecValidationError
from hprs.spec.expression import (
    And,
    Binary,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    Or,
    Predicate,
    Relation,
    as_expression,
)
from hprs.spec.inference import Inferred, infer
from hprs.spec.interval import Interval
from hprs.spec.task import (
    Constant,
    Definition,
    Preference,
    Requirement,
    Signal,
    Source,
    Task,
)
from hprs.spec.vocabulary import CLASSES, FUNCTIONS, REDUCTIONS

Known = dict[str, Inferred]

_WORDS = ("x", "y", "v", "speed", "theta", "_d", "Beam", "info", "obs", "inn", "order", "note")
_UNITS = ("", "", "m", "m/s", "rad", "°", "% of full # scale", "\\", "λ·x²")
_KEYS = ("pose", "lidar", "in", "signal", "not_far", "_k")
_RANK = {"safety": 0, "target": 1, "comfort": 2}


def numbers() -> SearchStrategy[float]:
    """Numbers as the language writes them: finite and not negative."""
    return st.one_of(
        st.integers(0, 12).map(float),
        st.floats(0.0, 100.0),
        st.sampled_from([0.1, 1e-7, 5e-324, 1e16, 123456789012345680.0, 0.30000000000000004]),
    )


@st.composite
def tasks(draw: DrawFn, *, vectors: bool = True, max_requirements: int = 5) -> Task:
    """A task that `Task` accepts."""
    names = _names(draw)
    known: Known = {}
    constants = tuple(_constant(draw, known, next_name) for next_name in _some(draw, names, 2))
    signals = tuple(
        _signal(draw, known, name, vectors=vectors) for name in _some(draw, names, 4, least=1)
    )
    definitions = tuple(_definition(draw, known, name) for name in _some(draw, names, 3))
    requirements = _requirements(draw, known, _some(draw, names, max_requirements))
    return Task(signals, requirements, constants, definitions, _preferences(draw, requirements))


@st.composite
def signals_for(
    draw: DrawFn, task: Task, batch_shape: tuple[int, ...] = ()
) -> dict[str, np.ndarray]:
    """Signals inside their ranges: `batch_shape`, and one more axis where they are vectors."""
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return {
        signal.name: _sample(
            generator,
            task.ranges[signal.name],
            batch_shape if signal.length is None else (*batch_shape, signal.length),
        )
        for signal in task.signals
    }


@st.composite
def expressions(draw: DrawFn, known: Mapping[str, Inferred], *, depth: int = 4) -> Expression:
    """An expression over known names that is defined everywhere in their ranges."""
    return _expression(draw, known, depth)


def reduced(expression: Expression, known: Mapping[str, Inferred], function: str) -> Expression:
    """The expression, reduced by the function if it is a vector; by max, if that is too large."""
    if infer(expression, known).length is None:
        return expression
    made = Call(function, (expression,))
    try:
        infer(made, known)
    except SpecValidationError:
        return Call("max", (expression,))
    return made


def _sample(generator: np.random.Generator, range_: Interval, shape: tuple[int, ...]) -> np.ndarray:
    low, high = np.clip([range_.low, range_.high], -1e3, 1e3)
    if low >= high:
        low, high = (
            (range_.low, range_.low + 1e3)
            if math.isfinite(range_.low)
            else (
                range_.high - 1e3,
                range_.high,
            )
        )
    values = np.clip(low + (high - low) * generator.random(shape), low, high)
    choice = generator.integers(0, 10, shape)
    return np.where(choice == 0, low, np.where(choice == 1, high, values))


def _names(draw: DrawFn) -> Callable[[], str]:
    used: list[str] = []

    def next_name() -> str:
        name = f"{draw(st.sampled_from(_WORDS))}{len(used)}"
        used.append(name)
        return name

    return next_name


def _some(draw: DrawFn, names: Callable[[], str], most: int, *, least: int = 0) -> list[str]:
    return [names() for _ in range(draw(st.integers(least, most)))]


def _constant(draw: DrawFn, known: Known, name: str) -> Constant:
    value = _expression(draw, known, 2)
    inferred = infer(value, known)
    known[name] = inferred
    return Constant(name, value)


def _signal(draw: DrawFn, known: Known, name: str, *, vectors: bool) -> Signal:
    length = draw(st.none() | st.integers(1, 4)) if vectors else None
    low = draw(st.integers(-800, 800)) / 8
    high = low + draw(st.integers(1, 1600)) / 16
    ends = [as_expression(low), as_expression(high)]
    constants = [c for c, found in known.items() if found.constant and found.range.low > low]
    match draw(st.sampled_from(["finite"] * 6 + ["below", "above", "constant", "degrees"])):
        case "below":
            low, ends[0] = -math.inf, Negate(Name("inf"))
        case "above":
            high, ends[1] = math.inf, Name("inf")
        case "constant" if constants:
            chosen = draw(st.sampled_from(constants))
            high, ends[1] = known[chosen].range.low, Name(chosen)
        case "degrees" if low <= 0.0 < high:
            ends[1] = Binary("*", Number(high), Name("deg"))
            high = high * math.pi / 180.0
            if not low < high:
                high, ends[1] = 1.0, Number(1.0)
        case _:
            pass
    known[name] = Inferred(Interval(low, high), length)
    initially = None
    if draw(st.booleans()) and math.isfinite(low) and math.isfinite(high):
        initially = ends[draw(st.integers(0, 1))]
    source = draw(st.none() | _sources(length))
    unit = draw(st.sampled_from(_UNITS))
    return Signal(name, *ends, source=source, length=length, initially=initially, unit=unit)


@st.composite
def _sources(draw: DrawFn, length: int | None) -> Source:
    root = draw(st.sampled_from(["obs", "obs", "action", "last_action", "info"]))
    keys: tuple[str, ...] = ()
    if root in ("obs", "info"):
        least = 1 if root == "info" else 0
        keys = tuple(draw(st.lists(st.sampled_from(_KEYS), min_size=least, max_size=2)))
    if length is None:
        return Source(root, keys, draw(st.none() | st.integers(-3, 9)))
    end = st.none() | st.integers(-9, 9)
    return Source(root, keys, draw(st.none() | st.tuples(end, end)))


def _definition(draw: DrawFn, known: Known, name: str) -> Definition:
    value = _expression(draw, known, 3)
    inferred = infer(value, known)
    low, high = inferred.range.low, inferred.range.high
    known[name] = inferred
    if not draw(st.booleans()) or not -1e100 < low < high < 1e100:
        return Definition(name, value)
    known[name] = Inferred(inferred.range, inferred.length, inferred.constant)
    return Definition(name, value, as_expression(low), as_expression(high))


def _requirements(draw: DrawFn, known: Known, labels: list[str]) -> tuple[Requirement, ...]:
    requirements: list[Requirement] = []
    kinds = list(CLASSES)
    for label in labels:
        kind = draw(st.sampled_from(kinds))
        if CLASSES[kind] == "target":
            kinds = ["ensure", "encourage"]
        finite = CLASSES[kind] != "safety"
        requirements.append(Requirement(kind, label, _predicate(draw, known, 2, finite=finite)))
    return tuple(requirements)


def _preferences(draw: DrawFn, requirements: tuple[Requirement, ...]) -> tuple[Preference, ...]:
    """Pairs that agree with one linear order, so that none closes a cycle."""
    line = sorted(draw(st.permutations(requirements)), key=lambda r: _RANK[r.requirement_class])
    pairs = [(a.label, b.label) for i, a in enumerate(line) for b in line[i + 1 :]]
    if not pairs:
        return ()
    return tuple(Preference(*pair) for pair in draw(st.lists(st.sampled_from(pairs), max_size=4)))


def _predicate(draw: DrawFn, known: Known, depth: int, *, finite: bool) -> Predicate:
    kinds = ["comparison"] * 3 + (["chain", "and", "or"] if depth else [])
    kind = draw(st.sampled_from(kinds))
    if kind == "comparison":
        return _comparison(draw, known, finite=finite)
    if kind == "chain":
        return _chain(draw, known, finite=finite)
    count = draw(st.integers(2, 3))
    parts = tuple(_predicate(draw, known, depth - 1, finite=finite) for _ in range(count))
    return And(parts) if kind == "and" else Or(parts)


def _comparison(draw: DrawFn, known: Known, *, finite: bool) -> Comparison:
    reduction = draw(st.sampled_from(sorted(REDUCTIONS)))
    left = reduced(_expression(draw, known, 3), known, reduction)
    relation = draw(st.sampled_from(_RELATIONS))
    if draw(st.integers(0, 3)) == 0:
        right = reduced(_expression(draw, known, 2), known, reduction)
        comparison = Comparison(left, relation, right)
        if _meant(comparison, known, finite=finite):
            return comparison
    return _against_a_threshold(draw, known, left, relation, finite=finite)


def _chain(draw: DrawFn, known: Known, *, finite: bool) -> Predicate:
    middle = reduced(_expression(draw, known, 2), known, "max")
    first = _against_a_threshold(
        draw, known, middle, draw(st.sampled_from([">=", ">"])), finite=finite
    )
    relation = draw(st.sampled_from(_RELATIONS))
    second = _against_a_threshold(draw, known, middle, relation, finite=finite)
    return And((Comparison(first.right, _MIRROR[first.relation], first.left), second))


_RELATIONS: tuple[Relation, ...] = ("<=", "<", ">=", ">")
_MIRROR: Mapping[Relation, Relation] = {"<=": ">=", "<": ">", ">=": "<=", ">": "<"}


def _against_a_threshold(
    draw: DrawFn, known: Known, left: Expression, relation: Relation, *, finite: bool
) -> Comparison:
    """The expression against a number that it can reach, clipped if it must be bounded."""
    range_ = infer(left, known).range
    if max(-range_.low, range_.high) > 1e6 and (finite or draw(st.booleans())):
        limit = Number(float(draw(st.integers(1, 100))))
        left = Call("clip", (left, Negate(limit), limit))
        range_ = infer(left, known).range
    low, high = max(range_.low, -1e6), min(range_.high, 1e6)
    width = high - low if high - low > 1e-6 else 1.0
    share = draw(st.floats(0.05, 1.2)) * width
    threshold = as_expression(low + share if relation[0] == "<" else high - share)
    comparison = Comparison(left, relation, threshold)
    if not _meant(comparison, known, finite=finite):
        return Comparison(Number(0.0), "<=", Number(1.0))
    if draw(st.booleans()):
        return Comparison(threshold, _MIRROR[relation], left)
    return comparison


def _meant(comparison: Comparison, known: Known, *, finite: bool) -> bool:
    """Whether the comparison can hold, and has a finite lower bound where one is needed."""
    try:
        margin = infer(comparison.margin, known).range
    except SpecValidationError:
        return False
    return margin.high > 0.0 and (math.isfinite(margin.low) or not finite)


def _expression(draw: DrawFn, known: Mapping[str, Inferred], depth: int) -> Expression:
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        return _leaf(draw, known)
    parts = [_expression(draw, known, depth - 1)]

    def another() -> Expression:
        return _expression(draw, known, depth - 1)

    match draw(st.sampled_from(["negate", "binary", "binary", "call", "reduce", "square"])):
        case "negate":
            made: Expression = Negate(parts[0])
        case "square":
            made = Binary("*", parts[0], parts[0])
        case "binary":
            made = Binary(draw(st.sampled_from(["+", "-", "*", "/", "**"])), parts[0], another())
        case "reduce":
            function = draw(st.sampled_from(sorted(REDUCTIONS)))
            if infer(parts[0], known).length is None:
                parts += [another() for _ in range(draw(st.integers(0, 2)))]
            made = Call(function, tuple(parts))
        case _:
            function = draw(st.sampled_from(sorted(set(FUNCTIONS) - REDUCTIONS)))
            parts += [another() for _ in range(FUNCTIONS[function][0] - 1)]
            made = Call(function, tuple(parts))
    try:
        infer(made, known)
    except SpecValidationError:
        return parts[0]
    return made


def _leaf(draw: DrawFn, known: Mapping[str, Inferred]) -> Expression:
    names = sorted(known)
    match draw(st.sampled_from(["name"] * 5 + ["number", "number", "degrees", "builtin"])):
        case "degrees":
            return Binary("*", Number(draw(numbers())), Name("deg"))
        case "builtin":
            return Name(draw(st.sampled_from(["pi", "deg"])))
        case "name" if names:
            return Name(draw(st.sampled_from(names)))
        case _:
            return Number(draw(numbers()))
