"""What is said of Python objects of the wrong kind in a task that is built in Python."""

from __future__ import annotations

from hprs.errors import SpecTypeError


def not_a_predicate(context: str, found: object) -> SpecTypeError:
    """The error of something that stands where a predicate is needed.

    Args:
        context: What needs it, with its verb: "requirement 'near' needs".
        found: What stands there.
    """
    advice = ""
    if isinstance(found, bool):
        advice = " There is no ==, `and` or `or`: write abs(a - b) <= tolerance, & and |."
    elif isinstance(found, str):
        advice = " A text is read by hprs.parse_task."
    return SpecTypeError(f"{context} a comparison such as x <= 1, got {shown(found)}.{advice}")


def not_an_expression(node: str, found: object) -> SpecTypeError:
    """The error of something that stands where a node needs an expression."""
    return SpecTypeError(
        f"{node} needs expressions, got {shown(found)}. Build it with operators, as in "
        "x + 1 <= y, or with hprs.call."
    )


def shown(value: object) -> str:
    """A value as a message shows it."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
