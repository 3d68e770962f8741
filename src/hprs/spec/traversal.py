"""What expressions and predicates are made of: their comparisons and the names they mention."""

from __future__ import annotations

from collections.abc import Iterator

from hprs.spec.expression import (
    Binary,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    Predicate,
)
from hprs.spec.vocabulary import BUILTIN_CONSTANTS


def comparisons(predicate: Predicate) -> tuple[Comparison, ...]:
    """The comparisons of a predicate, from left to right."""
    if isinstance(predicate, Comparison):
        return (predicate,)
    return tuple(leaf for part in predicate.parts for leaf in comparisons(part))


def names(node: Expression | Predicate) -> frozenset[str]:
    """The names that an expression or predicate refers to, builtin constants left out."""
    return frozenset(mentions(node))


def mentions(node: Expression | Predicate) -> Iterator[str]:
    """Every mention of a name in an expression or predicate, builtin constants left out."""
    waiting: list[Expression | Predicate] = [node]
    while waiting:
        match part := waiting.pop():
            case Number():
                pass
            case Name(name):
                if name not in BUILTIN_CONSTANTS:
                    yield name
            case Negate(operand):
                waiting.append(operand)
            case Binary(_, left, right) | Comparison(left, _, right):
                waiting += (left, right)
            case _:
                waiting += part.arguments if isinstance(part, Call) else part.parts
