"""The study behind a benchmark's settings: every reward with the same few candidates.

    .venv/bin/python benchmarks/settings.py hprs/SafeDriving-v0
    .venv/bin/python benchmarks/settings.py hprs/SafeDriving-v0 --tables-only

Each reward has the same budget: the settings of the benchmark's file, and one change of them at a
time. Seeds are from 1000 on; those of the tables, 0 to 9, stay unseen. What counts is S+T over the
last three evaluations of a training. Writes results/ppo/<environment>/settings.csv. What was
trained before is not trained again.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import tyro

from hprs.rewards.shaping import End
from hprs.training.algorithms import parse_settings
from hprs.training.configuration import Configuration
from hprs.training.configure import configure
from hprs.training.run_directory import RunDirectory, create_runs, folder_of

RESULTS = Path(__file__).parent.parent / "results" / "ppo"
CANDIDATES = (
    "",
    "gamma=0.995",
    "ent_coef=0.01",
    "learning_rate=linear_0.0003",
    "log_std_init=-1",
    "gae_lambda=0.98",
    "n_steps=128",
)
REWARDS = (
    "hprs:paper",
    "hprs:released",
    "hprs:invariant",
    "env",
    "sparse",
    "tltl",
    "bhnr",
    "morl-uniform:paper",
    "morl-decreasing:paper",
)
LAST = 3
"""Evaluations that count, of ten episodes each."""


@dataclass(frozen=True)
class SettingsStudy:
    """Train every reward with every candidate."""

    environment: tyro.conf.Positional[str]
    steps: int = 500_000
    """Environment steps of a training."""
    seeds: int = 3
    """Training seeds, from 1000 on."""
    workers: int = 2
    """Processes side by side."""
    out: Path = Path("runs/settings")
    """Where run directories are made."""
    tables_only: bool = False
    """Train nothing: print the table of what is there."""


def train(study: SettingsStudy) -> None:
    """Train what is missing, a reward after the other, and write down how it ended."""
    from rich.console import Console

    from hprs.cli.population_progress import PopulationProgress
    from hprs.training.population import train_population

    for reward in REWARDS:
        wanted = [
            (candidate, configured(study, reward, candidate, 1000 + seed))
            for candidate in CANDIDATES
            for seed in range(study.seeds)
        ]
        new = [one for _, one in wanted if not path_of(one, study.out).exists()]
        if new:
            create_runs(new, study.out)
        runs = [RunDirectory(path_of(one, study.out)) for _, one in wanted]
        with PopulationProgress(Console(), runs, study.workers) as progress:
            outcomes = train_population(runs, progress, workers=study.workers)
        if any(outcome.state == "interrupted" for outcome in outcomes):
            raise SystemExit("stopped; the same command goes on")
        rows = [
            (reward, candidate or "the file's", one.seed, f"{ended(run):.3f}")
            for (candidate, one), run in zip(wanted, runs, strict=True)
        ]
        write(study, reward, rows)


def configured(study: SettingsStudy, reward: str, candidate: str, seed: int) -> Configuration:
    """One training."""
    name, _, end = reward.partition(":")
    options: Mapping[str, Any] = {"end": cast("End", end)} if end else {}
    return configure(
        study.environment,
        reward=name,
        settings=parse_settings([candidate] if candidate else []),
        steps=study.steps,
        seed=seed,
        **options,
    )


def path_of(configuration: Configuration, out: Path) -> Path:
    """Where its run directory is."""
    return folder_of(configuration, out) / f"seed-{configuration.seed}"


def ended(run: RunDirectory) -> float:
    """S+T over the last evaluations."""
    rows = run.evaluations()
    last = sorted({row["step"] for row in rows})[-LAST:]
    return float(np.mean([row["pam"] >= 1.5 for row in rows if row["step"] in last]))


def table_of(study: SettingsStudy) -> Path:
    """The file with the results of an environment."""
    return RESULTS / study.environment.partition("/")[2].partition("-")[0].lower() / "settings.csv"


def read(study: SettingsStudy) -> list[list[str]]:
    """Rows of reward, candidate, seed and S+T."""
    if not table_of(study).exists():
        return []
    with table_of(study).open(newline="") as stream:
        return list(csv.reader(stream))[1:]


def write(study: SettingsStudy, reward: str, rows: Sequence[tuple[Any, ...]]) -> None:
    """Replace the rows of a reward."""
    kept = [row for row in read(study) if row[0] != reward]
    with table_of(study).open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(("reward", "settings", "seed", "S+T"))
        writer.writerows([*kept, *rows])


def print_table(study: SettingsStudy) -> None:
    """A row a reward, a column a candidate: mean over seeds."""
    rows = read(study)
    columns = list(dict.fromkeys(row[1] for row in rows))
    print("| reward | " + " | ".join(columns) + " |")
    print("|---" * (len(columns) + 1) + "|")
    for reward in dict.fromkeys(row[0] for row in rows):
        means = [
            np.mean([float(row[3]) for row in rows if row[:2] == [reward, column]])
            for column in columns
        ]
        print(f"| {reward} | " + " | ".join(f"{mean:.2f}" for mean in means) + " |")


if __name__ == "__main__":
    chosen = tyro.cli(SettingsStudy, description=__doc__)
    if not chosen.tables_only:
        train(chosen)
    print_table(chosen)
