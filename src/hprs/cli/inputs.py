"""Resolves what a user names on the command line."""

from __future__ import annotations

from hprs.errors import UsageError
from hprs.spec.task import Task


def task_by_name(name: str) -> Task:
    """The task of a file, or of a benchmark.

    Raises:
        UsageError: There is neither.
        SpecError: The task is wrong.
    """
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
