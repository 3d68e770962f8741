"""Trains the runs that `hprs train` has made or found, and says how it went."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from hprs.training.configuration import Configuration
from hprs.training.population import Outcome, train_population
from hprs.training.trainers import prefers_programs, trainer_of

if TYPE_CHECKING:
    from hprs.training.run_directory import RunDirectory


def train_all(runs: Sequence[RunDirectory], place: Path, workers: int | None) -> int:
    """Train runs, and return the exit code.

    Args:
        runs: The runs.
        place: What to name when all of them are meant.
        workers: How many are trained side by side; None: as suits their trainer.

    Raises:
        HprsError: There is one run only, and something is wrong with it.
    """
    from hprs.cli.console import console

    out = console()
    for line in dict.fromkeys(line for run in runs for line in demands(run.configuration)):
        out.print(line, soft_wrap=True)
    train = _train_one if len(runs) == 1 else _train_several
    return train(runs, place, out, workers)


def default_workers(configurations: Sequence[Configuration]) -> int:
    """How many of some runs are trained side by side, where the user does not say."""
    if not any(configuration.trainer == "jax" for configuration in configurations):
        return 1
    if prefers_programs(configurations):
        return 0
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def demands(configuration: Configuration) -> list[str]:
    """What the reward asks of the learner, and whether it gets it."""
    from hprs.rewards.registry import reward_kind
    from hprs.training.parameters import demanded_parameters

    asked = reward_kind(configuration.reward).demands
    lines: list[str] = []
    for name, value in demanded_parameters(asked).items():
        found = configuration.parameters.get(name)
        kept = "" if found == value else f", but it was set to {json.dumps(found)}"
        lines.append(
            f"The reward {configuration.reward} asks for {name}={json.dumps(value)}{kept}."
        )
    return lines


def _train_one(runs: Sequence[RunDirectory], place: Path, out: Console, workers: int | None) -> int:
    from hprs.cli.progress import TrainingProgress

    del workers
    [run] = runs
    listener = TrainingProgress(out)
    try:
        complete = trainer_of(run.configuration)(run, listener)
    except KeyboardInterrupt:
        complete = False
    if not complete:
        out.print(f"Stopped. Go on with: hprs train --resume {place}", soft_wrap=True)
        return 130
    # A run that was complete already has said so.
    if listener.trainings:
        out.print(f"Wrote {run.path}", soft_wrap=True)
    out.print(f"Assess it with: hprs evaluate {run.path}", soft_wrap=True)
    return 0


def _train_several(
    runs: Sequence[RunDirectory], place: Path, out: Console, workers: int | None
) -> int:
    from hprs.cli.console import plural
    from hprs.cli.population_progress import PopulationProgress

    count = min(
        default_workers([run.configuration for run in runs]) if workers is None else workers,
        len(runs),
    )
    with PopulationProgress(out, runs, count) as progress:
        outcomes = train_population(runs, progress, workers=count)
    failed = [outcome for outcome in outcomes if outcome.state == "failed"]
    for outcome in failed:
        out.print(f"Failed: {outcome.run.path}: {outcome.text}", soft_wrap=True)
    if any(outcome.state == "interrupted" for outcome in outcomes):
        out.print(f"Stopped. Go on with: hprs train --resume {place}", soft_wrap=True)
        return 130
    for folder, complete in _complete(outcomes).items():
        found = plural(complete, "run")
        out.print(f"Assess {found} with: hprs evaluate {folder}", soft_wrap=True)
    if failed:
        out.print(f"{len(failed)} of {len(runs)} trainings failed.", soft_wrap=True)
    return 1 if failed else 0


def _complete(outcomes: Sequence[Outcome]) -> dict[Path, int]:
    """Folder of seeds to how many of them are complete."""
    found: dict[Path, int] = {}
    for outcome in outcomes:
        if outcome.state == "complete":
            folder = outcome.run.path.parent
            found[folder] = found.get(folder, 0) + 1
    return found
