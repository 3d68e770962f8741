"""What is said of Python objects of the wrong kind in a task that is built in Python."""

from __future__ import annotations

from collections.abc import Collection

from hprs.errors import Position, SpecTypeError, SpecValidationError, did_you_mean


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


def check_choice(
    what: str, found: object, options: Collection[str], position: Position | None
) -> None:
    """Check that something is one of several words or signs.

    Args:
        what: What it is, with its article: "a relation".
        found: What stands there.
        options: What may stand there.
        position: Where.

    Raises:
        SpecValidationError: It is none of them.
    """
    if isinstance(found, str) and found in options:
        return
    advice = did_you_mean(found, options) if isinstance(found, str) else ""
    if found in ("==", "!="):
        advice = " Measured numbers are almost never equal: write abs(a - b) <= tolerance."
    raise SpecValidationError(
        f"{what} is one of {', '.join(options)}, got {shown(found)}.{advice}", position
    )


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
