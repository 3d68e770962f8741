"""Compiles a task's comparisons to margin functions, by closures over one table of operations.

The same compiler serves Python floats and arrays of every namespace; only the operations differ.
Nothing is generated as source text, and nothing of a task is ever executed.
"""

from __future__ import annotations

import operator
from collections import Counter
from collections.abc import Callable, Mapping, MutableMapping, Sequence
from functools import lru_cache, reduce
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from hprs.spec.expression import (
    Binary,
    BinaryOperator,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
)
from hprs.spec.inference import Inferred, infer
from hprs.spec.namespace import Array, Operations, array_operations, float_operations
from hprs.spec.task import Task
from hprs.spec.traversal import mentions, names
from hprs.spec.vocabulary import REDUCTIONS

Values = MutableMapping[str, Array]
Function = Callable[[Values], Array]


_DEEPEST_INLINED = 50
"""Levels of expressions, one inside another, that become one closure at most: closures recurse."""


class _Compiled(NamedTuple):
    """A compiled expression: a function of the signals, or a constant; vectors have a length."""

    function: Function | None
    constant: float
    length: int | None
    signal: str = ""
    """The name, where the expression is one."""
    magnitude_of: str = ""
    """The name, where the expression is its absolute value."""


class _Compiler:
    def __init__(self, known: Mapping[str, Inferred], xp: ModuleType | None) -> None:
        self._known = known
        self.inlined: dict[str, _Compiled] = {}
        """Definitions that are used once: compiled in place instead of stored."""
        self._floats = xp is None
        self._scalar: Operations = float_operations() if xp is None else array_operations(xp)
        self._vector: Operations = array_operations(np if xp is None else xp)

    def compile(self, node: Expression) -> _Compiled:
        match node:
            case Number(value):
                return _Compiled(None, value, None)
            case Name(name):
                return self._name(node, name)
            case Negate(operand):
                parts = (self.compile(operand),)
            case Binary(_, left, right):
                parts = (self.compile(left), self.compile(right))
            case _:
                parts = tuple(self.compile(argument) for argument in node.arguments)
        if all(part.function is None for part in parts):
            return _Compiled(None, infer(node, self._known).range.low, None)
        length = next((part.length for part in parts if part.length is not None), None)
        match node:
            case Negate():
                return _Compiled(_negated(parts[0]), 0.0, length)
            case Binary(symbol):
                return _Compiled(self._binary(symbol, parts[0], parts[-1], length), 0.0, length)
            case _:
                return self._call(node.function, parts, length)

    def _name(self, node: Name, name: str) -> _Compiled:
        if name in self.inlined:
            return self.inlined[name]
        inferred = infer(node, self._known)
        if inferred.constant:
            return _Compiled(None, inferred.range.low, None)
        return _Compiled(operator.itemgetter(name), 0.0, inferred.length, signal=name)

    def _binary(
        self, symbol: BinaryOperator, left: _Compiled, right: _Compiled, length: int | None
    ) -> Function:
        quick = _difference(left, right) if symbol == "-" else None
        if quick is not None:
            return quick
        f, g = self._aligned(left, length), self._aligned(right, length)
        a, b = left.constant, right.constant
        if symbol == "**" and g is None and b == 0.5:
            # NumPy takes the root of an array and not of a number; they differ at -0.0 and -inf.
            return _applied(self._operations(length)["sqrt"], _function(left))
        if symbol in ("/", "**"):
            operation = self._operations(length)[symbol]
            if f is None:
                divisor = g or _constant(b)
                return lambda v: operation(a, divisor(v))
            if g is None:
                exponent = int(b) if symbol == "**" and b.is_integer() and abs(b) < 64 else b
                return lambda v: operation(f(v), exponent)
            return lambda v: operation(f(v), g(v))
        return _arithmetic(symbol, f, a, g, b)

    def _call(self, name: str, parts: Sequence[_Compiled], length: int | None) -> _Compiled:
        if name in REDUCTIONS and length is not None:
            return _Compiled(self._reduction(name, _function(parts[0])), 0.0, None)
        if len(parts) == 1:
            return self._of_one(name, parts[0])
        return _Compiled(self._of_many(name, parts, length), 0.0, length)

    def _reduction(self, name: str, vector: Function) -> Function:
        return _applied(self._scalar[f"reduce {name}"], vector)

    def _of_one(self, name: str, part: _Compiled) -> _Compiled:
        inner = _function(part)
        if name in ("abs", "norm"):
            magnitude: Function = lambda v: abs(inner(v))  # noqa: E731
            return _Compiled(magnitude, 0.0, part.length, magnitude_of=part.signal)
        if name in REDUCTIONS:
            return part
        return _Compiled(_applied(self._operations(part.length)[name], inner), 0.0, part.length)

    def _of_many(self, name: str, parts: Sequence[_Compiled], length: int | None) -> Function:
        if name in ("sum", "mean"):
            return self._sum(parts, 1.0 if name == "sum" else 1.0 / len(parts))
        if name == "norm":
            total, root = self._sum([_squared(part) for part in parts], 1.0), self._scalar["sqrt"]
            return lambda v: root(total(v))
        return self._several(self._operations(length)[name], parts, length)

    def _several(
        self, operation: Callable[..., Array], parts: Sequence[_Compiled], length: int | None
    ) -> Function:
        functions = [self._aligned(part, length) for part in parts]
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

    def _sum(self, parts: Sequence[_Compiled], factor: float) -> Function:
        functions = [part.function for part in parts if part.function is not None]
        offset = sum(part.constant for part in parts if part.function is None)
        total: Function = lambda v: reduce(operator.add, [f(v) for f in functions])  # noqa: E731
        if factor == 1.0 and offset == 0.0:
            return total
        return lambda v: (total(v) + offset) * factor

    def _operations(self, length: int | None) -> Operations:
        return self._scalar if length is None else self._vector

    def _aligned(self, part: _Compiled, length: int | None) -> Function | None:
        """The part's function; a batch of scalars gets a last axis where it meets vectors."""
        function = part.function
        if function is None or self._floats or part.length == length:
            return function
        return lambda v: function(v)[..., None]


def _difference(left: _Compiled, right: _Compiled) -> Function | None:
    """A single closure for `c - abs(x)`, `c - x` and `x - c`, the most common margins."""
    if left.signal and right.function is None:
        signal, constant = left.signal, right.constant
        return lambda v: v[signal] - constant
    if right.signal and left.function is None:
        signal, constant = right.signal, left.constant
        return lambda v: constant - v[signal]
    if right.magnitude_of and left.function is None:
        signal, constant = right.magnitude_of, left.constant
        return lambda v: constant - abs(v[signal])
    return None


def _squared(part: _Compiled) -> _Compiled:
    function = part.function
    if function is None:
        return _Compiled(None, part.constant**2, None)
    square: Function = lambda v: (x := function(v)) * x  # noqa: E731
    return _Compiled(square, 0.0, part.length)


def _negated(part: _Compiled) -> Function:
    function = _function(part)
    return lambda v: -function(v)


def _applied(operation: Callable[..., Array], function: Function) -> Function:
    return lambda v: operation(function(v))


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


class Margins(NamedTuple):
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
    depths: dict[str, int] = {}
    for definition in task.definitions:
        part = compiler.compile(definition.value)
        if part.function is None or not uses[definition.name]:
            continue
        depth = definition.value.depth + max(
            (depths.get(name, 0) for name in mentions(definition.value)), default=0
        )
        if uses[definition.name] == 1 and depth <= _DEEPEST_INLINED:
            compiler.inlined[definition.name] = part
            depths[definition.name] = depth
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
