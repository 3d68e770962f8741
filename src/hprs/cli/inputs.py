"""Resolves what a user names on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import tyro

from hprs.errors import UsageError
from hprs.spec.task import Task

Constants = Annotated[
    tyro.conf.UseAppendAction[tuple[str, ...]],
    tyro.conf.arg(
        name="const",
        metavar="NAME=VALUE",
        help="Another value for a constant of the task, such as mark=-1 or tilt='12 deg'.",
    ),
]
"""The option `--const` of every subcommand that reads a task."""


def task_by_name(name: str, constants: Sequence[str] = ()) -> Task:
    """The task of a file, or of a benchmark.

    Args:
        name: File, or id of a benchmark.
        constants: Other values for its constants, as `NAME=VALUE`.

    Raises:
        UsageError: There is neither, or a pair is malformed.
        SpecError: The task is wrong, or has no such constant.
    """
    from hprs.spec.parameters import override, parse_constants
    from hprs.spec.parser import parse_task
    from hprs.spec.task_file import normalised

    text = _text(name)
    task = parse_task(text, path=name)
    if not constants:
        return task
    return override(task, parse_constants(constants), path=name, text=normalised(text))


def _text(name: str) -> str:
    from pathlib import Path

    from hprs.errors import did_you_mean
    from hprs.spec.task_file import read_text

    if Path(name).exists():
        return read_text(name)
    from hprs.envs.registration import BENCHMARKS, task_text_of

    text = task_text_of(name)
    if text is not None:
        return text
    file = Path(name)
    near = [other.name for other in file.parent.glob("*.hprs")]
    guess = did_you_mean(file.name, near) or did_you_mean(name, BENCHMARKS)
    raise UsageError(f"there is no task '{name}'.{guess}")
