"""The policies that `hprs robustness` tests, and where they were trained."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hprs.cli.assessed_run import (
    bundle_file,
    check_which,
    environment_of,
    environment_of_bundle,
    named_environment,
    policies_of_runs,
    policy_by_name,
)
from hprs.deploy import load_bundle
from hprs.envs.driving.options import BACKWARDS, track_names
from hprs.envs.functional import FUNCTIONAL
from hprs.errors import UsageError
from hprs.training.algorithms import parse_settings
from hprs.training.policies import BUNDLE_SUFFIX, Policy
from hprs.training.run_directory import find_runs
from hprs.wrappers.single import TaskWrapper


@dataclass(frozen=True)
class Subject:
    """One policy, or the seeds of one training."""

    name: str
    """As it is shown."""
    environment: str
    """What it drives."""
    make: Callable[[], TaskWrapper]
    """Makes that environment as it was in the training."""
    policies: Mapping[str, Policy]
    """By the names of their seeds."""
    seen: Sequence[str]
    """Names of the tracks of its training."""


def subject_of(name: str, *, on: str | None, which: str, options: Sequence[str]) -> Subject:
    """What a user names.

    Args:
        name: A run directory or a bundle.
        on: Environment of a bundle that does not say where it was trained.
        which: The policy of a run.
        options: Options of the environment over those of the training, as `KEY=VALUE`.

    Raises:
        UsageError: It is no driving policy, or does not say where it was trained.
        HprsError: As `hprs evaluate` does.
    """
    more: dict[str, Any] = {
        "task_path": None,
        "constants": (),
        "options": options,
        "horizon": None,
    }
    given = parse_settings(options, "--env")
    if (bundle := bundle_file(name)) is not None:
        return _bundle(name, bundle, on, given, more)
    runs = find_runs(Path(name))
    configuration = runs[0].configuration
    _check_drives(name, configuration.environment)
    make = environment_of(runs[0], **more)
    return Subject(
        name=name,
        environment=configuration.environment,
        make=make,
        policies=policies_of_runs(runs, check_which(which), make),
        seen=_seen(configuration.environment, {**configuration.environment_options, **given}),
    )


def _bundle(
    name: str, file: str, on: str | None, given: dict[str, Any], more: dict[str, Any]
) -> Subject:
    provenance = load_bundle(file).provenance
    told = provenance.get("environment")
    environment = told or on
    if environment is None:
        raise UsageError(
            f"'{name}' does not say where it was trained; name the environment, as in "
            "--on hprs/SafeDriving-v0."
        )
    _check_drives(name, environment)
    trained = provenance.get("environment_options", {}) if told else {}
    make = (
        environment_of_bundle(file, **more)[2] if told else named_environment(environment, **more)
    )
    return Subject(
        name=Path(name).name.removesuffix(BUNDLE_SUFFIX),
        environment=environment,
        make=make,
        policies={"policy": policy_by_name(file, make)},
        seen=_seen(environment, {**trained, **given}),
    )


def _check_drives(name: str, environment: str) -> None:
    if environment not in FUNCTIONAL:
        raise UsageError(
            f"'{name}' is of {environment}; robustness is tested in {' and '.join(FUNCTIONAL)}."
        )


def _seen(environment: str, options: Mapping[str, Any]) -> list[str]:
    """Names of the tracks of a training."""
    names = track_names(options.get("tracks", FUNCTIONAL[environment].tracks))
    if not options.get("reverse", False):
        return names
    turned = [name.removesuffix(BACKWARDS) for name in names]
    return [
        plain if plain != name else name + BACKWARDS
        for name, plain in zip(names, turned, strict=True)
    ]
