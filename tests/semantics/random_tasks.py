"""Random tasks and signals from a seed; every function of the language turns up among them."""

from __future__ import annotations

from typing import Any

import numpy as np

from hprs.errors import SpecValidationError
from hprs.spec.expression import (
    And,
    Binary,
    Call,
    Comparison,
    Expression,
    Name,
    Number,
    Or,
    Predicate,
    as_expression,
)
from hprs.spec.inference import infer
from hprs.spec.task import Definition, Preference, Requirement, Signal, Task

SCALARS, VECTORS = ("a", "b", "c"), ("p", "q")
LENGTH = 3


def random_task(
    seed: int,
    *,
    depth: int = 3,
    target: str | None = "any",
    counts: tuple[int, int] | None = None,
    preferences: int = 0,
) -> Task:
    """A task; `target` is a kind, None (no target) or "any"; `counts` are safety and comfort."""
    rng = np.random.default_rng(seed)
    signals = _signals(rng)
    definition = Definition("d", _scalar(rng, depth - 1, ()))
    scope = Task(signals=signals, definitions=(definition,))
    safety, comfort = counts or (int(rng.integers(0, 4)), int(rng.integers(0, 4)))
    kinds = ["ensure"] * safety + ["encourage"] * comfort
    if target == "any":
        target = [None, "achieve", "conquer"][rng.integers(3)]
    kinds += [target] if target else []
    rng.shuffle(kinds)
    requirements = tuple(
        _requirement(rng, scope, kind or "ensure", f"r{i}", depth)
        for i, kind in enumerate(kinds or ["ensure"])
    )
    task = Task(signals=signals, definitions=(definition,), requirements=requirements)
    for _ in range(preferences):
        task = _prefer(rng, task)
    return task


def random_signals(
    seed: int, task: Task, shape: tuple[int, ...], *, spread: float = 1.0
) -> dict[str, Any]:
    """Values inside the signals' ranges; a `spread` above 1 leaves them on both sides."""
    rng = np.random.default_rng(seed)
    found = {}
    for signal in task.signals:
        bounds = task.ranges[signal.name]
        full = shape if signal.length is None else (*shape, signal.length)
        share = 0.5 + spread * (rng.uniform(size=full) - 0.5)
        found[signal.name] = np.asarray(bounds.low + share * (bounds.high - bounds.low))
    return found


def _signals(rng: np.random.Generator) -> tuple[Signal, ...]:
    def ends() -> tuple[float, float]:
        low = round(rng.uniform(-3, 1), 2)
        return low, low + round(rng.uniform(0.5, 4), 2)

    return (
        *(Signal(name, *ends()) for name in SCALARS),
        *(Signal(name, *ends(), length=LENGTH) for name in VECTORS),
    )


def _requirement(
    rng: np.random.Generator, scope: Task, kind: str, label: str, depth: int
) -> Requirement:
    while True:
        requirement = Requirement(kind, label, _predicate(rng, scope, depth, 2))  # type: ignore[arg-type]
        try:
            Task(signals=scope.signals, definitions=scope.definitions, requirements=(requirement,))
        except SpecValidationError:
            continue
        return requirement


def _predicate(rng: np.random.Generator, scope: Task, depth: int, nesting: int) -> Predicate:
    if nesting and rng.random() < 0.3:
        connective = And if rng.random() < 0.5 else Or
        parts = tuple(_predicate(rng, scope, depth, nesting - 1) for _ in range(rng.integers(2, 4)))
        return connective(parts)
    relation = ("<=", "<", ">=", ">")[rng.integers(4)]
    left = _scalar(rng, depth, ("d",))
    if rng.random() < 0.1:
        return Comparison(as_expression(float(rng.uniform(-1, 1))), relation, Number(0.25))
    if rng.random() < 0.3:
        return Comparison(left, relation, _scalar(rng, depth - 1, ("d",)))
    try:
        bounds = infer(left, scope.analysis.known).range
    except SpecValidationError:
        return Comparison(left, relation, Number(0.5))
    share = rng.uniform(0.2, 0.8)
    threshold = float(bounds.low + share * (bounds.high - bounds.low))
    right = as_expression(threshold if np.isfinite(threshold) else 0.5)
    return (
        Comparison(left, relation, right)
        if rng.random() < 0.7
        else Comparison(right, relation, left)
    )


def _scalar(rng: np.random.Generator, depth: int, others: tuple[str, ...]) -> Expression:
    """A scalar expression that is defined everywhere in the signals' ranges."""
    if depth <= 0:
        leaves = (*map(Name, (*SCALARS, *others)), as_expression(round(rng.uniform(-2, 2), 2)))
        return leaves[rng.integers(len(leaves))]

    def part() -> Expression:
        return _scalar(rng, depth - 1, others)

    def vector() -> Expression:
        return _vector(rng, depth - 1, others)

    def positive() -> Expression:
        return abs(part()) + 0.5

    def several() -> tuple[Expression, ...]:
        return tuple(part() for _ in range(rng.integers(1, 4)))

    makers = (
        lambda: part() + part(),
        lambda: part() - part(),
        lambda: part() * part(),
        lambda: -part(),
        lambda: part() / positive(),
        lambda: Name("b") * Name("b"),
        lambda: part() ** float(rng.integers(0, 4)),
        lambda: positive() ** (-1.0),
        lambda: positive() ** clip(part()),
        lambda: Number(2.0) ** clip(part()),
        lambda: abs(part()),
        lambda: Call("clip", (part(), as_expression(-0.5), part())),
        lambda: Call("clip", (as_expression(0.1), as_expression(-0.5), part())),
        lambda: Call("sqrt", (positive(),)),
        lambda: Call("exp", (clip(part()),)),
        lambda: Call("log", (positive(),)),
        lambda: Call("sin", (part(),)),
        lambda: Call("cos", (part(),)),
        lambda: Call("tan", (clip(part()),)),
        lambda: Call("atan2", (part(), positive())),
        lambda: Call("hypot", (part(), part())),
        lambda: Call("sign", (part() + 0.0123,)),
        lambda: Call(_choice(rng, ("min", "max", "sum", "mean", "norm")), several()),
        lambda: Call(_choice(rng, ("min", "max", "sum", "mean", "norm")), (vector(),)),
    )
    return makers[rng.integers(len(makers))]()


def _vector(rng: np.random.Generator, depth: int, others: tuple[str, ...]) -> Expression:
    if depth <= 0:
        return Name(_choice(rng, VECTORS))

    def vector() -> Expression:
        return _vector(rng, depth - 1, others)

    def scalar() -> Expression:
        return _scalar(rng, depth - 1, others)

    makers = (
        lambda: vector() - scalar(),
        lambda: scalar() * vector(),
        lambda: Binary("+", vector(), vector()),
        lambda: abs(vector()),
        lambda: vector() ** 2.0,
        lambda: scalar() / (abs(vector()) + 0.5),
        lambda: Call("sin", (vector(),)),
        lambda: Call("hypot", (vector(), scalar())),
        lambda: Call("clip", (vector(), as_expression(-0.5), as_expression(1.0))),
        lambda: Call("sign", (vector() + 0.0123,)),
    )
    return makers[rng.integers(len(makers))]()


def clip(expression: Expression) -> Call:
    """An expression held within [-1, 1]."""
    return Call("clip", (expression, as_expression(-1.0), as_expression(1.0)))


def _choice(rng: np.random.Generator, names: tuple[str, ...]) -> str:
    return names[rng.integers(len(names))]


def _prefer(rng: np.random.Generator, task: Task) -> Task:
    """One more random preference, where it is allowed."""
    higher, lower = (task.labels[i] for i in rng.integers(len(task.labels), size=2))
    try:
        return Task(
            task.signals,
            task.requirements,
            definitions=task.definitions,
            preferences=(*task.preferences, Preference(higher, lower)),
        )
    except SpecValidationError:
        return task
