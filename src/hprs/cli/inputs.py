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

    return override(_named(name), parse_constants(constants), path=name)


def _named(name: str) -> Task:
    from pathlib import Path

    from hprs.errors import did_you_mean
    from hprs.spec.parser import load_task

    if Path(name).exists():
        return load_task(name)
    from hprs.envs.registration import BENCHMARKS, task_of

    task = task_of(name)
    if task is not None:
        return task
    file = Path(name)
    near = [other.name for other in file.parent.glob("*.hprs")]
    guess = did_you_mean(file.name, near) or did_you_mean(name, BENCHMARKS)
    raise UsageError(f"there is no task '{name}'.{guess}")
