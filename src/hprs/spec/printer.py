"""From a `Task` to its text, with no more parentheses than needed.

`parse_task(format_task(task)) == task` for every task. Constants come first, then signals,
definitions, requirements and preferences; comments and positions are not part of a task.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from hprs.spec.expression import (
    And,
    Binary,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    Predicate,
)
from hprs.spec.task import (
    Constant,
    Definition,
    Preference,
    Requirement,
    Signal,
    Task,
    require_task,
)

_T = TypeVar("_T")

# How tightly an operator binds; an operand that binds less tightly needs parentheses.
_SUM, _PRODUCT, _SIGN, _POWER, _ATOM = range(5)
_BINDING = {"+": _SUM, "-": _SUM, "*": _PRODUCT, "/": _PRODUCT, "**": _POWER}
_OPERANDS = {
    "+": (_SUM, _PRODUCT),
    "-": (_SUM, _PRODUCT),
    "*": (_PRODUCT, _SIGN),
    "/": (_PRODUCT, _SIGN),
    "**": (_ATOM, _SIGN),
}


def format_task(task: Task) -> str:
    """The text of a task."""
    require_task(task)
    groups = (
        _lines(_constant, task.constants),
        _lines(_signal, task.signals),
        _lines(_definition, task.definitions),
        _lines(_requirement, task.requirements),
        _lines(_preference, task.preferences),
    )
    return "\n".join(group for group in groups if group)


def format_expression(expression: Expression) -> str:
    """The text of an expression."""
    return _expression(expression, _SUM)


def format_predicate(predicate: Predicate) -> str:
    """The text of a predicate."""
    match predicate:
        case Comparison():
            return _chain((predicate,))
        case And(parts):
            return " and ".join(_conjuncts(parts))
        case _:
            return " or ".join(map(format_predicate, predicate.parts))


def _lines(write: Callable[[_T], str], statements: Iterable[_T]) -> str:
    return "".join(f"{write(statement)}\n" for statement in statements)


def _constant(constant: Constant) -> str:
    return f"const {constant.name} = {format_expression(constant.value)}"


def _signal(signal: Signal) -> str:
    length = "" if signal.length is None else f"[{signal.length}]"
    source = "" if signal.source is None else f" = {signal.source}"
    initially = ""
    if signal.initially is not None:
        initially = f" initially {format_expression(signal.initially)}"
    unit = f' "{signal.unit}"' if signal.unit else ""
    return f"signal {signal.name}{length}{source}{initially}{_range(signal.low, signal.high)}{unit}"


def _definition(definition: Definition) -> str:
    ends = ""
    if definition.low is not None and definition.high is not None:
        ends = _range(definition.low, definition.high)
    return f"let {definition.name} = {format_expression(definition.value)}{ends}"


def _range(low: Expression, high: Expression) -> str:
    return f" in [{format_expression(low)}, {format_expression(high)}]"


def _requirement(requirement: Requirement) -> str:
    return f"{requirement.kind} {requirement.label}: {format_predicate(requirement.predicate)}"


def _preference(preference: Preference) -> str:
    return f"prefer {preference.higher} over {preference.lower}"


def _conjuncts(parts: Sequence[Predicate]) -> list[str]:
    """The parts of a conjunction, with `a <= x and x <= b` joined to `a <= x <= b`."""
    written: list[str] = []
    chain: list[Comparison] = []
    for part in parts:
        if chain and not (isinstance(part, Comparison) and _continues(chain[-1], part)):
            written.append(_chain(chain))
            chain.clear()
        if isinstance(part, Comparison):
            chain.append(part)
        else:
            written.append(f"({format_predicate(part)})")
    if chain:
        written.append(_chain(chain))
    return written


def _continues(first: Comparison, second: Comparison) -> bool:
    return first.right == second.left and first.relation[0] == second.relation[0]


def _chain(links: Sequence[Comparison]) -> str:
    rest = (f" {link.relation} {format_expression(link.right)}" for link in links)
    return format_expression(links[0].left) + "".join(rest)


def _expression(expression: Expression, binding: int) -> str:
    """The text of an expression as an operand that has to bind at least this tightly."""
    text, own = _bound(expression)
    return text if own >= binding else f"({text})"


def _bound(expression: Expression) -> tuple[str, int]:
    match expression:
        case Number(value):
            return _number(value), _ATOM
        case Name(name):
            return name, _ATOM
        case Call(function, arguments):
            return f"{function}({', '.join(map(format_expression, arguments))})", _ATOM
        case Negate(operand):
            return f"-{_expression(operand, _SIGN)}", _SIGN
        case Binary("*", Number(value), Name("deg")):
            return f"{_number(value)} deg", _POWER
        case _:
            operator = expression.operator
            first, second = _OPERANDS[operator]
            left, right = _expression(expression.left, first), _expression(expression.right, second)
            return f"{left} {operator} {right}", _BINDING[operator]


def _number(value: float) -> str:
    """The shortest text that gives the same number; whole numbers without a point."""
    exact = float(value)
    if exact.is_integer() and exact < 1e16:
        return str(int(exact))
    return repr(exact).replace("e+", "e")
