"""Compiles a task's comparisons to margin functions, by closures over one table of operations.

The same compiler serves Python floats and arrays of every namespace; only the operations differ.
Nothing is generated as source text, and nothing of a task is ever executed.
"""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from types import ModuleType
from typing import Any

import numpy as np

from hprs.spec.expression import (
    REDUCTIONS,
    Binary,
    BinaryOperator,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    mentions,
    names,
)
from hprs.spec.inference import Inferred, infer
from hprs.spec.namespace import Array, Operations, array_operations, float_operations
from hprs.spec.task import Task

Values = MutableMapping[str, Array]
Function = Callable[[Values], Array]


@dataclass(frozen=True)
class _Compiled:
    """A compiled expression: a function of the signals, or a constant; vectors have a length."""

    function: Function | None
    constant: float
    length: int | None


class _Compiler:
    def __init__(self, known: Mapping[str, Inferred], xp: ModuleType | None) -> None:
        self._known = known
        self.inlined: dict[str, _Compiled] = {}
        """Definitions that are used once: compiled in place instead of stored."""
        self._floats = xp is None
        self._scalar: Operations = float_operations() if xp is None else array_operations(xp)
        self._vector: Operations = array_operations(np if xp is None else xp)

    def compile(self, node: Expression) -> _Compiled:
        inferred = infer(node, self._known)
        if inferred.constant:
            return _Compiled(None, inferred.range.low, None)
        quick = self._of_one_signal(node)
        if quick is not None:
            return _Compiled(quick, 0.0, inferred.length)
        match node:
            case Name(name) if name in self.inlined:
                return self.inlined[name]
            case Name(name):
                return _Compiled(operator.itemgetter(name), 0.0, inferred.length)
            case Negate(operand):
                inner = _function(self.compile(operand))
                return _Compiled(lambda v: -inner(v), 0.0, inferred.length)
            case Binary(symbol, left, right):
                function = self._binary(symbol, self.compile(left), self.compile(right), inferred)
                return _Compiled(function, 0.0, inferred.length)
            case Call(name, arguments):
                parts = [self.compile(argument) for argument in arguments]
                return _Compiled(self._call(name, parts, inferred), 0.0, inferred.length)
            case Number():  # pragma: no cover - numbers are constant
                raise AssertionError(node)

    def _of_one_signal(self, node: Expression) -> Function | None:
        """A single closure for `c - abs(x)`, `c - x` and `x - c`, the most common margins."""
        if not self.inlined.keys().isdisjoint(names(node)):
            return None
        match node:
            case Binary("-", Name(name), right) if not self._known_constant(node.left):
                constant = self._constant(right)
                return None if constant is None else lambda v: v[name] - constant
            case Binary("-", left, Name(name)) if not self._known_constant(node.right):
                constant = self._constant(left)
                return None if constant is None else lambda v: constant - v[name]
            case Binary("-", left, Call("abs", (Name(name),))):
                constant = self._constant(left)
                return None if constant is None else lambda v: constant - abs(v[name])
            case _:
                return None

    def _constant(self, node: Expression) -> float | None:
        inferred = infer(node, self._known)
        return inferred.range.low if inferred.constant else None

    def _known_constant(self, node: Expression) -> bool:
        return self._constant(node) is not None

    def _binary(
        self, symbol: BinaryOperator, left: _Compiled, right: _Compiled, result: Inferred
    ) -> Function:
        f, g = self._aligned(left, result), self._aligned(right, result)
        a, b = left.constant, right.constant
        if symbol in ("/", "**"):
            operation = self._operations(result)[symbol]
            if f is None:
                divisor = g or _constant(b)
                return lambda v: operation(a, divisor(v))
            if g is None:
                exponent = int(b) if symbol == "**" and b.is_integer() and abs(b) < 64 else b
                return lambda v: operation(f(v), exponent)
            return lambda v: operation(f(v), g(v))
        return _arithmetic(symbol, f, a, g, b)

    def _call(self, name: str, parts: Sequence[_Compiled], result: Inferred) -> Function:
        if len(parts) == 1:
            inner = _function(parts[0])
            if name in REDUCTIONS and parts[0].length is None:
                return self._call("abs", parts, result) if name == "norm" else inner
            if name == "abs":
                return lambda v: abs(inner(v))
            if name in REDUCTIONS:
                operation = self._scalar[f"reduce {name}"]
            else:
                operation = self._operations(result)[name]
            return lambda v: operation(inner(v))
        if name in ("sum", "mean"):
            return self._sum(parts, 1.0 if name == "sum" else 1.0 / len(parts), result)
        if name == "norm":
            squares = [self._power_of_two(part, result) for part in parts]
            total, root = self._sum(squares, 1.0, result), self._scalar["sqrt"]
            return lambda v: root(total(v))
        return self._several(self._operations(result)[name], parts, result)

    def _several(
        self, operation: Callable[..., Array], parts: Sequence[_Compiled], result: Inferred
    ) -> Function:
        functions = [self._aligned(part, result) for part in parts]
        constants = [part.constant for part in parts]
        if operation is float_operations()["max"] and len(parts) == 2 and functions[1] is None:
            return _at_least(functions[0] or _constant(constants[0]), constants[1])
        if len(parts) == 2:
            f, g = functions
            a, b = constants
            if f is not None and g is not None:
                return lambda v: operation(f(v), g(v))
            if f is not None:
                return lambda v: operation(f(v), b)
            second = g or _constant(b)
            return lambda v: operation(a, second(v))
        pairs = list(zip(functions, constants, strict=True))
        return lambda v: operation(*[c if f is None else f(v) for f, c in pairs])

    def _sum(self, parts: Sequence[_Compiled], factor: float, result: Inferred) -> Function:
        functions = [f for f in (self._aligned(part, result) for part in parts) if f is not None]
        offset = sum(part.constant for part in parts if part.function is None)
        total: Function = lambda v: reduce(operator.add, [f(v) for f in functions])  # noqa: E731
        if factor == 1.0 and offset == 0.0:
            return total
        return lambda v: (total(v) + offset) * factor

    def _power_of_two(self, part: _Compiled, result: Inferred) -> _Compiled:
        function = self._aligned(part, result)
        if function is None:
            return _Compiled(None, part.constant**2, None)
        return _Compiled(lambda v: (x := function(v)) * x, 0.0, part.length)

    def _operations(self, result: Inferred) -> Operations:
        return self._scalar if result.length is None else self._vector

    def _aligned(self, part: _Compiled, result: Inferred) -> Function | None:
        """The part's function; a batch of scalars gets a last axis where it meets vectors."""
        function = part.function
        if function is None or self._floats or part.length == result.length:
            return function
        return lambda v: function(v)[..., None]


def _function(part: _Compiled) -> Function:
    return part.function or _constant(part.constant)


def _arithmetic(
    symbol: BinaryOperator, f: Function | None, a: float, g: Function | None, b: float
) -> Function:
    table: dict[BinaryOperator, Function]
    if f is None:
        right = g or _constant(b)
        table = {
            "+": lambda v: a + right(v),
            "-": lambda v: a - right(v),
            "*": lambda v: a * right(v),
        }
    elif g is None:
        table = {
            "+": lambda v: f(v) + b,
            "-": lambda v: f(v) - b,
            "*": lambda v: f(v) * b,
        }
    else:
        table = {
            "+": lambda v: f(v) + g(v),
            "-": lambda v: f(v) - g(v),
            "*": lambda v: f(v) * g(v),
        }
    return table[symbol]


@dataclass(frozen=True)
class Margins:
    """Margin functions of some comparisons over one kind of numbers.

    The margin of a comparison without signals is a Python float, whatever the batch.
    """

    definitions: tuple[tuple[str, Function], ...]
    functions: tuple[Function, ...]

    def __call__(self, signals: Mapping[str, Array]) -> list[Any]:
        """The margins of the comparisons, in their order, over one state or a batch."""
        values: Values = dict(signals) if self.definitions else signals  # type: ignore[assignment]
        for name, function in self.definitions:
            values[name] = function(values)
        return [function(values) for function in self.functions]


def compile_margins(
    task: Task, comparisons: Sequence[Comparison], xp: ModuleType | None
) -> Margins:
    """Compile margin functions of a task's comparisons.

    Args:
        task: The task whose names the comparisons use.
        comparisons: What to compile, in the order wanted.
        xp: The array namespace; None for Python floats (vectors are then NumPy arrays).
    """
    compiler = _Compiler(task.analysis.known, xp)
    uses = Counter(
        name
        for node in (*comparisons, *(d.value for d in task.definitions))
        for name in mentions(node)
    )
    definitions: list[tuple[str, Function]] = []
    for definition in task.definitions:
        part = compiler.compile(definition.value)
        if part.function is None or not uses[definition.name]:
            continue
        if uses[definition.name] == 1:
            compiler.inlined[definition.name] = part
        else:
            definitions.append((definition.name, part.function))
    parts = [compiler.compile(comparison.margin) for comparison in comparisons]
    return Margins(
        tuple(definitions), tuple(part.function or _constant(part.constant) for part in parts)
    )


def _at_least(function: Function, least: float) -> Function:
    """`max(x, least)` in one closure: distances to an interval are made of it."""

    def apply(values: Values) -> float:
        value = function(values)
        return least if value < least else value

    return apply


def _constant(value: float) -> Function:
    return lambda values: value


@lru_cache(maxsize=256)
def used_signals(task: Task) -> tuple[str, ...]:
    """The signals that some requirement or definition of a task refers to, in the text's order."""
    used = frozenset[str]().union(
        *(names(r.predicate) for r in task.requirements),
        *(names(d.value) for d in task.definitions),
    )
    return tuple(signal.name for signal in task.signals if signal.name in used)
