"""What is left to do of a grid, and what it will take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal, TypeAlias

from hprs.training.configuration import Configuration
from hprs.training.run_directory import RUN_FILE, RunDirectory, create_runs, folder_of
from hprs.training.toml_text import parse_toml

State: TypeAlias = Literal["new", "begun", "done"]
_RATES = "rates.toml"
_MEGABYTE = 1e6


@dataclass(frozen=True)
class Planned:
    """One training of a grid."""

    run: RunDirectory
    configuration: Configuration
    state: State
    """Nothing recorded yet; begun, so that it goes on; or trained to its end."""
    step: int
    """The step of its newest evaluation; 0 if there is none."""

    @property
    def left(self) -> int:
        """Environment steps that are left."""
        return 0 if self.state == "done" else max(0, self.configuration.steps - self.step)


@dataclass(frozen=True)
class Estimate:
    """What trainings will take, by rates that were measured once on one machine."""

    seconds: float
    """Of wall-clock time."""
    memory: float
    """MB of all processes together."""
    disk: float
    """MB of all run directories."""
    unknown: tuple[str, ...]
    """Algorithm and environment of which no rate is known, and which are not in the numbers."""


def plan(configurations: Sequence[Configuration], out: Path) -> list[Planned]:
    """How far each training is; a run is found by the hash of its configuration.

    Args:
        configurations: The trainings.
        out: Where their run directories are, or will be.
    """
    return [_planned(configuration, out) for configuration in configurations]


def prepare(planned: Sequence[Planned], out: Path) -> list[RunDirectory]:
    """Make the run directories of what is new.

    Returns:
        The runs that are to be trained, whether they are new or go on.

    Raises:
        RunError: One cannot be written.
    """
    new = [entry.configuration for entry in planned if entry.state == "new"]
    if new:
        create_runs(new, out)
    return [entry.run for entry in planned if entry.state != "done"]


def estimate(planned: Sequence[Planned], workers: int) -> Estimate:
    """What the rest of a grid will take.

    Args:
        planned: The trainings.
        workers: Processes that train side by side, a core each.
    """
    left = [entry for entry in planned if entry.left]
    cost = [_seconds(entry) for entry in left]
    unknown = {_pair(e.configuration) for e, seconds in zip(left, cost, strict=True) if not seconds}
    busy = max(min(workers, len(left)), 1)
    longest = sorted((_memory(entry.configuration) for entry in left), reverse=True)[:busy]
    known = [seconds for seconds in cost if seconds]
    return Estimate(
        # The last trainings leave cores idle: no fewer seconds than the longest one takes.
        seconds=max(sum(known) / busy, max(known, default=0.0)),
        memory=sum(longest),
        disk=sum(_disk(entry.configuration) for entry in left),
        unknown=tuple(sorted(unknown)),
    )


def _planned(configuration: Configuration, out: Path) -> Planned:
    run = RunDirectory(folder_of(configuration, out) / f"seed-{configuration.seed}")
    if not (run.path / RUN_FILE).exists() or not run.has_begun:
        return Planned(run, configuration, "new", 0)
    step = max(run.policy_step("last"), 0)
    return Planned(run, configuration, "done" if step >= configuration.steps else "begun", step)


def _pair(configuration: Configuration) -> str:
    return f"{configuration.algorithm} on {configuration.environment}"


def _seconds(planned: Planned) -> float:
    """Seconds that the rest of a training takes a core; 0 where no rate is known."""
    configuration = planned.configuration
    rate = _measured(configuration, "steps_a_second")
    return planned.left / rate if rate else 0.0


def _memory(configuration: Configuration) -> float:
    return _rates()["memory"] + _remembered(configuration)


def _disk(configuration: Configuration) -> float:
    return _measured(configuration, "disk") + _remembered(configuration)


def _remembered(configuration: Configuration) -> float:
    """MB of the transitions that a training remembers at its end."""
    rows = min(configuration.parameters.get("buffer_size", 0), configuration.steps)
    return rows * _measured(configuration, "transition") / _MEGABYTE


def _measured(configuration: Configuration, what: str) -> float:
    tables: Mapping[str, Any] = _rates().get(configuration.algorithm, {})
    return float(tables.get(what, {}).get(configuration.environment, 0.0))


@cache
def _rates() -> Mapping[str, Any]:
    text = resources.files("hprs.experiments").joinpath(_RATES).read_text(encoding="utf-8")
    return parse_toml(text, _RATES)
