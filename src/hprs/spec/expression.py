"""Expressions and predicates of the task language, as frozen data.

An expression is a number, a name, a sign change, a binary operation or a call; a predicate is a
comparison of two expressions, or a conjunction or disjunction of predicates. Both can be written in
Python with the usual operators: `abs(x - 1.0) <= 0.25`, `(x >= 0) & (y >= 0)`.

Nodes know the place in the text they came from (`position`); it does not count in comparisons.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from numbers import Real
from typing import Literal, NoReturn, TypeAlias, cast, get_args

from hprs.errors import Position, SpecTypeError, SpecValidationError
from hprs.spec.misuse import check_choice, not_a_predicate, not_an_expression, shown
from hprs.spec.vocabulary import FUNCTIONS

MAX_DEPTH = 100
"""Deepest nesting of an expression; it keeps every recursion over one shallow."""

BinaryOperator: TypeAlias = Literal["+", "-", "*", "/", "**"]
Relation: TypeAlias = Literal["<=", "<", ">=", ">"]
_BINARY_OPERATORS, _RELATIONS = get_args(BinaryOperator), get_args(Relation)

ExpressionLike: TypeAlias = "Operand | float"


class Operand:
    """What arithmetic and comparison operators accept; gives them their Python spelling."""

    # NumPy's scalars leave operations with an operand to the operand.
    __array_ufunc__ = None

    def expression(self) -> Expression:
        """This operand as an expression."""
        raise NotImplementedError

    def __add__(self, other: ExpressionLike) -> Binary:
        """Sum."""
        return Binary("+", self.expression(), as_expression(other))

    def __radd__(self, other: float) -> Binary:
        """Sum with a number on the left."""
        return Binary("+", as_expression(other), self.expression())

    def __sub__(self, other: ExpressionLike) -> Binary:
        """Difference."""
        return Binary("-", self.expression(), as_expression(other))

    def __rsub__(self, other: float) -> Binary:
        """Difference with a number on the left."""
        return Binary("-", as_expression(other), self.expression())

    def __mul__(self, other: ExpressionLike) -> Binary:
        """Product."""
        return Binary("*", self.expression(), as_expression(other))

    def __rmul__(self, other: float) -> Binary:
        """Product with a number on the left."""
        return Binary("*", as_expression(other), self.expression())

    def __truediv__(self, other: ExpressionLike) -> Binary:
        """Quotient."""
        return Binary("/", self.expression(), as_expression(other))

    def __rtruediv__(self, other: float) -> Binary:
        """Quotient with a number on the left."""
        return Binary("/", as_expression(other), self.expression())

    def __pow__(self, other: ExpressionLike) -> Binary:
        """Power."""
        return Binary("**", self.expression(), as_expression(other))

    def __rpow__(self, other: float) -> Binary:
        """Power of a number."""
        return Binary("**", as_expression(other), self.expression())

    def __mod__(self, other: object) -> NoReturn:
        """Teach: there is no such operation."""
        raise SpecTypeError("expressions have no % and no //; they have + - * / ** and hprs.call.")

    __rmod__ = __floordiv__ = __rfloordiv__ = __mod__

    def __float__(self) -> float:
        """Teach: functions of `math` compute with numbers."""
        raise SpecTypeError(
            'an expression is no number yet. Write hprs.call("sin", x) instead of math.sin(x).'
        )

    def __pos__(self) -> Expression:
        """This operand; a value needs no sign."""
        return self.expression()

    def __neg__(self) -> Negate:
        """Sign change."""
        return Negate(self.expression())

    def __abs__(self) -> Call:
        """Absolute value."""
        return Call("abs", (self.expression(),))

    def __le__(self, other: ExpressionLike) -> Comparison:
        """Predicate: at most."""
        return Comparison(self.expression(), "<=", as_expression(other))

    def __lt__(self, other: ExpressionLike) -> Comparison:
        """Predicate: less than."""
        return Comparison(self.expression(), "<", as_expression(other))

    def __ge__(self, other: ExpressionLike) -> Comparison:
        """Predicate: at least."""
        return Comparison(self.expression(), ">=", as_expression(other))

    def __gt__(self, other: ExpressionLike) -> Comparison:
        """Predicate: more than."""
        return Comparison(self.expression(), ">", as_expression(other))


def position_field() -> Position | None:
    """The field of every node that holds its place in the text; it never counts in comparisons."""
    return field(default=None, compare=False, repr=False, kw_only=True)


def _depth_field() -> int:
    return field(init=False, compare=False, repr=False, default=1)


class _Node(Operand):
    def expression(self) -> Expression:
        """This expression."""
        return cast("Expression", self)


def _set_depth_of(node: Negate | Binary | Call | Comparison, *operands: Expression) -> None:
    for operand in operands:
        if not isinstance(operand, _Node):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise not_an_expression(type(node).__name__, operand)
    _set_depth(node, *operands)


def _set_depth(node: Expression | Predicate, *children: Expression | Predicate) -> None:
    depth = 1 + max((child.depth for child in children), default=0)
    if depth > MAX_DEPTH:
        raise SpecValidationError(
            f"this expression is nested deeper than {MAX_DEPTH} levels. "
            "Give its parts names with `let`, or use sum(a, b, ...) for long sums.",
            node.position,
        )
    object.__setattr__(node, "depth", depth)


@dataclass(frozen=True)
class Number(_Node):
    """A number as written; never negative (`-2` is `Negate(Number(2))`) and always finite."""

    value: float
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Reject what the grammar could not have written."""
        _require_real(self.value, self.position)
        try:
            object.__setattr__(self, "value", float(self.value))
        except OverflowError:
            object.__setattr__(self, "value", math.inf)
        if not (math.isfinite(self.value) and math.copysign(1.0, self.value) > 0):
            raise SpecValidationError(
                f"a number must be finite and not negative, got {self.value}.", self.position
            )


@dataclass(frozen=True)
class Name(_Node):
    """A reference to a signal, a constant or a definition."""

    name: str
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Check the type; only a task knows which names there are."""
        if not isinstance(self.name, str):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise SpecTypeError(f"a name is a text, got {shown(self.name)}.", self.position)


@dataclass(frozen=True)
class Negate(_Node):
    """A sign change."""

    operand: Expression
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Check the operand and bound the depth."""
        _set_depth_of(self, self.operand)


@dataclass(frozen=True)
class Binary(_Node):
    """An arithmetic operation on two expressions."""

    operator: BinaryOperator
    left: Expression
    right: Expression
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Check the operator and the operands, and bound the depth."""
        check_choice("an operator", self.operator, _BINARY_OPERATORS, self.position)
        _set_depth_of(self, self.left, self.right)


@dataclass(frozen=True)
class Call(_Node):
    """A call of one of `FUNCTIONS`."""

    function: str
    arguments: tuple[Expression, ...]
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Check name, number and kind of arguments, and bound the depth."""
        if not isinstance(self.function, str) or self.function not in FUNCTIONS:  # pyright: ignore[reportUnnecessaryIsInstance]
            raise SpecValidationError(
                f"unknown function '{self.function}'. Functions are {', '.join(FUNCTIONS)}.",
                self.position,
            )
        if not isinstance(self.arguments, tuple | list):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise not_an_expression("Call", self.arguments)
        least, most = FUNCTIONS[self.function]
        if not least <= len(self.arguments) <= (most or len(self.arguments)):
            wanted = f"{least}" if most == least else f"at least {least}"
            raise SpecValidationError(
                f"{self.function}() takes {wanted} argument{'s' * (wanted != '1')}, "
                f"got {len(self.arguments)}.",
                self.position,
            )
        object.__setattr__(self, "arguments", tuple(self.arguments))
        _set_depth_of(self, *self.arguments)


Expression: TypeAlias = Number | Name | Negate | Binary | Call


class _Connectable:
    """Gives predicates `&` and `|`, and refuses to be a Python truth value."""

    def __and__(self, other: Predicate) -> And:
        """Conjunction."""
        return And((_predicate(self), other))

    def __or__(self, other: Predicate) -> Or:
        """Disjunction."""
        return Or((_predicate(self), other))

    def __rand__(self, other: object) -> And:
        """Teach: the left side is no predicate."""
        raise not_a_predicate("& needs", other)

    def __ror__(self, other: object) -> Or:
        """Teach: the left side is no predicate."""
        raise not_a_predicate("| needs", other)

    def __invert__(self) -> NoReturn:
        """Teach: there is no negation."""
        raise SpecTypeError("there is no ~. Turn the comparison round: not (x <= 1) is x > 1.")

    def __bool__(self) -> bool:
        """Teach: a chain `a <= x <= b` or `and` would drop one half."""
        raise SpecTypeError(
            "a predicate has no truth value. Write (a <= x) & (x <= b) for a chain, & for and, "
            "| for or."
        )


def _predicate(value: _Connectable) -> Predicate:
    return cast("Predicate", value)


@dataclass(frozen=True)
class Comparison(_Connectable):
    """A comparison; its margin is the two sides' difference, positive when satisfied."""

    left: Expression
    relation: Relation
    right: Expression
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Check the relation and the sides, and bound the depth."""
        check_choice("a relation", self.relation, _RELATIONS, self.position)
        _set_depth_of(self, self.left, self.right)

    @property
    def strict(self) -> bool:
        """Whether a margin of exactly 0 violates the comparison."""
        return self.relation in ("<", ">")

    @property
    def margin(self) -> Binary:
        """The expression f with `f >= 0` iff the comparison holds (strictness aside)."""
        if self.relation in ("<=", "<"):
            return Binary("-", self.right, self.left, position=self.position)
        return Binary("-", self.left, self.right, position=self.position)


@dataclass(frozen=True)
class And(_Connectable):
    """All parts hold; nested conjunctions are flattened."""

    parts: tuple[Predicate, ...]
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Flatten, and bound the depth."""
        _flatten(self, And)


@dataclass(frozen=True)
class Or(_Connectable):
    """At least one part holds; nested disjunctions are flattened."""

    parts: tuple[Predicate, ...]
    position: Position | None = position_field()
    depth: int = _depth_field()

    def __post_init__(self) -> None:
        """Flatten, and bound the depth."""
        _flatten(self, Or)


Predicate: TypeAlias = Comparison | And | Or


def _flatten(node: And | Or, kind: type[And] | type[Or]) -> None:
    parts: list[Predicate] = []
    if not isinstance(node.parts, tuple | list):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise SpecTypeError(f"and / or need a tuple of conditions, got {shown(node.parts)}.")
    for part in node.parts:
        if not isinstance(part, _Connectable):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise not_a_predicate("and / or need", part)
        parts.extend(part.parts if isinstance(part, kind) else (part,))
    if len(parts) < 2:
        raise SpecValidationError("and / or need at least two parts.", node.position)
    object.__setattr__(node, "parts", tuple(parts))
    _set_depth(node, *parts)


def as_expression(value: ExpressionLike) -> Expression:
    """A Python number as an expression; expressions and signals pass through.

    Raises:
        SpecValidationError: The value is NaN, or an integer too large for a float.
        SpecTypeError: The value is neither a number nor an operand.
    """
    if isinstance(value, Operand):
        return value.expression()
    _require_real(value)
    try:
        number = float(value)
    except OverflowError:
        raise SpecValidationError("this number is too large for a float.") from None
    magnitude = Name("inf") if math.isinf(number) else Number(abs(number))
    return Negate(magnitude) if math.copysign(1.0, number) < 0 else magnitude


def _require_real(value: object, position: Position | None = None) -> None:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise SpecTypeError(f"expected a number or an expression, got {shown(value)}.", position)


def call(function: str, *arguments: ExpressionLike) -> Call:
    """A call of a function of the language, for tasks built in Python: `call("hypot", x, y)`."""
    return Call(function, tuple(as_expression(argument) for argument in arguments))
