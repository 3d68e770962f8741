"""A task's constants as its parameters: other values for them, from `NAME=VALUE` pairs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from hprs.errors import SpecError, UsageError
from hprs.spec.expression import Expression, ExpressionLike, as_expression
from hprs.spec.parser import parse_task
from hprs.spec.printer import format_expression
from hprs.spec.task import Task


def parse_constants(pairs: Iterable[str]) -> dict[str, Expression]:
    """Name to value, from pairs such as `mark=-1` or `tilt=12 deg`.

    Raises:
        UsageError: A pair is malformed, or names a constant a second time.
    """
    found: dict[str, Expression] = {}
    for pair in pairs:
        name, equals, value = (part.strip() for part in pair.partition("="))
        if not (name and equals and value):
            raise UsageError(f"a constant is given as NAME=VALUE, as in mark=-1; got '{pair}'.")
        if name in found:
            raise UsageError(f"the constant '{name}' is given twice.")
        try:
            task = parse_task(f"const {name} = {value}")
        except SpecError as error:
            raise UsageError(f"the constant '{pair}' cannot be meant: {error.message}") from None
        if task.constants[1:] or task != Task(constants=task.constants):
            raise UsageError(f"the constant '{name}' is given more than a value: '{value}'.")
        found[name] = task.constants[0].value
    return found


def override(
    task: Task, constants: Mapping[str, ExpressionLike], *, path: str, text: str | None = None
) -> Task:
    """`Task.with_constants` for a task of a file, which errors name.

    Args:
        task: The task.
        constants: Name to value.
        path: The file.
        text: What the task was parsed from, so that errors show the line.

    Raises:
        SpecError: There is no such constant, or the task cannot be meant with these values.
    """
    try:
        return task.with_constants(**constants)
    except SpecError as error:
        error.path, error.text = path, text
        if error.position is not None:
            values = ", ".join(
                f"{name} = {format_expression(as_expression(value))}"
                for name, value in constants.items()
            )
            error.message += f" Here, {values}."
        raise
