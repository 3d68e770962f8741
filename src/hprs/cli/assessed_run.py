"""What the subcommands share that let a policy act: its environment, and the policy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from hprs.errors import UsageError, did_you_mean

if TYPE_CHECKING:
    from hprs.deploy import Bundle
    from hprs.training.policies import Policy
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


def named_environment(
    name: str,
    *,
    task_path: str | None,
    constants: Sequence[str],
    options: Sequence[str],
    horizon: int | None,
) -> Callable[..., TaskWrapper]:
    """Makes an environment that the user names.

    Args:
        name: Gymnasium id, or `module:id`.
        task_path: A task file; None: the benchmark's own task.
        constants: Other values for constants of the task, as `NAME=VALUE`.
        options: Options of the environment, as `KEY=VALUE`.
        horizon: Another horizon.

    Raises:
        UsageError: The environment, an option or a file does not exist.
        SpecError: The task is wrong, or has no such constant.
    """
    from hprs.spec.parameters import parse_constants
    from hprs.training.algorithms import parse_settings
    from hprs.training.environment import check_options, find_task, make_environment

    task, _ = find_task(name, task_path, parse_constants(constants))
    given = parse_settings(options, "--env")
    check_options(name, given)

    def make(**more: Any) -> TaskWrapper:
        return make_environment(name, task, "sparse", horizon=horizon, **{**given, **more})

    return make


def bundle_file(subject: str) -> str | None:
    """The bundle that a path names: itself, or the one in a folder; None if there is none.

    Args:
        subject: What stands on the command line.
    """
    from pathlib import Path

    from hprs.training.policies import BUNDLE_SUFFIX
    from hprs.training.session import POLICY

    path = Path(subject)
    if path.suffix == BUNDLE_SUFFIX and path.is_file():
        return subject
    return str(path / POLICY) if (path / POLICY).is_file() else None


def environment_of_bundle(
    path: str,
    *,
    task_path: str | None,
    constants: Sequence[str],
    options: Sequence[str],
    horizon: int | None,
) -> tuple[str, Bundle, Callable[..., TaskWrapper]]:
    """The environment that a bundle was trained in, with its task.

    Args:
        path: The bundle's file.
        task_path: Another task file.
        constants: Other values for constants of the task, as `NAME=VALUE`.
        options: Other options of the environment, as `KEY=VALUE`.
        horizon: Another horizon.

    Returns:
        The environment's name, the bundle, and what makes the environment.

    Raises:
        BundleError: The bundle is damaged.
        UsageError: It does not say where it was trained, or an option or a file does not exist.
        SpecError: The task is wrong, or has no such constant.
    """
    from hprs.deploy import load_bundle
    from hprs.spec.json_format import task_from_json
    from hprs.spec.parameters import override, parse_constants
    from hprs.training.algorithms import parse_settings
    from hprs.training.environment import check_options, make_environment, read_task

    bundle = load_bundle(path)
    found = bundle.provenance
    name = found.get("environment")
    if not isinstance(name, str):
        raise UsageError(
            f"'{path}' does not say where it was trained; name the environment, as in "
            f"hprs evaluate ENV --policy {path}"
        )
    task = read_task(task_path)[0] if task_path else task_from_json(bundle.task)
    task = override(task, parse_constants(constants), path=task_path or path)
    given = parse_settings(options, "--env")
    merged = {**found.get("environment_options", {}), **given}
    check_options(name, merged)
    steps = horizon or found.get("horizon")

    def make(**more: Any) -> TaskWrapper:
        return make_environment(name, task, "sparse", horizon=steps, **{**merged, **more})

    return name, bundle, make


def policies_of_runs(
    runs: Sequence[RunDirectory], which: Which, make: Callable[[], TaskWrapper]
) -> dict[str, Policy]:
    """The policies of runs by the names of their seeds.

    Args:
        runs: One for each seed.
        which: The last or the best policy.
        make: Makes the environment in which they shall act.

    Raises:
        RunError: A run has no such policy.
        PolicyError: A policy was trained with other spaces than this environment's.
    """
    from hprs.training.policies import check_fits
    from hprs.training.trained import load_policy

    policies = {f"seed {run.configuration.seed}": load_policy(run, which) for run in runs}
    environment = make()
    try:
        for run, policy in zip(runs, policies.values(), strict=True):
            check_fits(str(run.policy(which)), policy, environment)
    finally:
        environment.close()
    return dict(policies)


def policy_by_name(name: str, make: Callable[[], TaskWrapper]) -> Policy:
    """A policy that is no run's, as `hprs.training.policies.named_policy` knows it."""
    from hprs.training.policies import named_policy

    environment = make()
    try:
        return named_policy(name, environment)
    finally:
        environment.close()
