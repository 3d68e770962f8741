"""What the subcommands share that let a run's policy act: its environment, and the policy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from hprs.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from hprs.training.run_directory import RunDirectory, Which
    from hprs.wrappers.single import TaskWrapper


def check_which(which: str) -> Which:
    """One of the policies that a run keeps.

    Raises:
        UsageError: It keeps no such policy.
    """
    from typing import cast

    from hprs.training.run_directory import WHICH

    if which not in WHICH:
        raise UsageError(
            f"--which is {' or '.join(WHICH)}, not '{which}'.{did_you_mean(which, WHICH)}"
        )
    return cast("Which", which)


def environment_of(
    run: RunDirectory,
    *,
    task_path: str | None,
    constants: Sequence[str],
    options: Sequence[str],
    horizon: int | None,
) -> Callable[..., TaskWrapper]:
    """Makes the environment of a run, with what the command line asks for instead.

    Args:
        run: The run.
        task_path: Another task file.
        constants: Other values for constants of the task, as `NAME=VALUE`.
        options: Other options of the environment, as `KEY=VALUE`.
        horizon: Another horizon.

    Raises:
        UsageError: An option or a file does not exist.
        SpecError: The task is wrong, or has no such constant.
    """
    from hprs.spec.parameters import override, parse_constants
    from hprs.training.algorithms import parse_settings
    from hprs.training.environment import check_options, make_environment, read_task

    configuration = run.configuration
    task = read_task(task_path)[0] if task_path else configuration.task
    task = override(task, parse_constants(constants), path=task_path or str(run.path))
    given = parse_settings(options, "--env")
    merged = {**configuration.environment_options, **given}
    if given:
        check_options(configuration.environment, merged)

    def make(**more: Any) -> TaskWrapper:
        return make_environment(
            configuration.environment,
            task,
            "sparse",
            horizon=horizon or configuration.horizon,
            **{**merged, **more},
        )

    return make
