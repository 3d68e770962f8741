"""Compares rewards: trains what is missing, assesses the last policies, writes tables.

    .venv/bin/python benchmarks/study.py hprs/SafeDriving-v0 hprs env tltl
    .venv/bin/python benchmarks/study.py hprs/SafeDriving-v0          # every condition
    .venv/bin/python benchmarks/study.py hprs/SafeDriving-v0 hprs:paper --algorithm sac \
        --steps 20000 --seeds 5 --env tracks=gm

A condition is a reward, `hprs:released` for another end of the episode, and settings behind that,
as in `hprs:paper:gamma=0.999`; `blind` stands for a critic that does not see the task's signals.
What was trained before is not trained again, and Ctrl-C loses nothing: the same command goes on.
Below results/ALGORITHM/ it leaves for each environment

    policies.csv    a row a policy: S, S+T, S+T+C, PAM and every requirement over 50 episodes
    curves.csv      a row an evaluation during the training: mean PAM, S, S+T and S+T+C
    *.bundle        last policies of the rewards that are kept

and prints the table of docs/benchmarks.md. `--first-seed 5 --seeds 5` adds seeds to those that are
there. Training seeds are 0 to 9, episodes those of
`hprs evaluate`, which no training and no choice of a setting has seen.
"""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
import tyro

from hprs.cli.console import console
from hprs.cli.grid_table import GridProgress
from hprs.experiments.plan import plan, prepare
from hprs.experiments.statistics import (
    failed_seeds,
    interquartile_mean,
    interval,
    steps_to,
)
from hprs.rewards.shaping import DEFAULT_END, ENDS, End
from hprs.semantics.assessment import accomplished_comfort, summarise
from hprs.training.algorithms import parse_settings
from hprs.training.configure import configure
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
from hprs.training.population import train_population
from hprs.training.run_directory import RunDirectory
from hprs.training.trained import load_policy

RESULTS = Path(__file__).parent.parent / "results"
EVALUATE_EVERY = {
    ("ppo", "hprs/SafeDriving-v0"): 2_000,
    ("ppo", "hprs/FollowLeader-v0"): 2_000,
    ("sac", "hprs/SafeDriving-v0"): 500,
    ("sac", "hprs/FollowLeader-v0"): 500,
}
"""Steps between evaluations, ten times as many after the 50th; elsewhere the default."""
BLIND = "critic_signals=false"
CONDITIONS = (
    "hprs:paper",
    "hprs:released",
    "hprs:invariant",
    "env",
    "sparse",
    "tltl",
    "bhnr",
    "morl-uniform:paper",
    "morl-decreasing:paper",
    "hprs:paper:blind",
    "hprs-no-comfort:paper",
    "morl-uniform:released",
    "morl-uniform:invariant",
    "morl-decreasing:released",
    "morl-decreasing:invariant",
    "rank-preserving",
    "pam",
    "hprs:paper:gamma=0.999",
    "hprs:released:gamma=0.999",
    "hprs:paper:log_std_init=-1.5",
    "hprs:released:log_std_init=-1.5",
)
"""The paper's six rewards with the ends of an episode first, then the others."""


@dataclass(frozen=True)
class Study:
    """Train, assess and compare."""

    environment: tyro.conf.Positional[str]
    conditions: tyro.conf.Positional[tuple[str, ...]] = CONDITIONS
    algorithm: Literal["ppo", "sac"] = "ppo"
    """What learns."""
    env: tuple[str, ...] = ()
    """Options of the environment, KEY=VALUE."""
    first_seed: int = 0
    """The first training seed."""
    seeds: int = 10
    """How many training seeds; what others were trained before stay in the tables."""
    steps: int | None = None
    """Environment steps of a training; default: those of the benchmark's file."""
    episodes: int = 50
    """Of the assessment of a policy."""
    workers: int = 2
    """Processes side by side."""
    keep: tuple[str, ...] = ("hprs",)
    """Rewards whose last policies are kept as bundles."""
    out: Path = Path("runs/study")
    """Where run directories are made."""
    tables_only: bool = False
    """Train and assess nothing: print the tables of what is there."""

    @property
    def folder(self) -> Path:
        """Where the results are."""
        name = self.environment.partition("/")[2].partition("-")[0].lower()
        options = [str(value) for value in parse_settings(self.env, "--env").values()]
        return RESULTS / self.algorithm / "-".join([name, *options])

    @property
    def interval(self) -> int | None:
        """Steps between evaluations; None: the default."""
        return EVALUATE_EVERY.get((self.algorithm, self.environment))


@dataclass(frozen=True)
class Condition:
    """What is compared."""

    reward: str
    end: End
    words: tuple[str, ...]
    """Settings that differ, as users write them."""

    @property
    def name(self) -> str:
        """Its name in the tables."""
        return " ".join([self.reward, *([self.end] if self.shaped else []), *self.words])

    @property
    def settings(self) -> dict[str, Any]:
        """Hyper-parameters that differ from the benchmark's."""
        return parse_settings([BLIND if word == "blind" else word for word in self.words])

    @property
    def shaped(self) -> bool:
        """Whether the end of the episode makes a difference."""
        return self.reward.startswith(("hprs", "morl"))


@dataclass
class Found:
    """What is known of one policy."""

    row: dict[str, Any]
    curve: list[dict[str, Any]] = field(default_factory=list)


def parsed(text: str) -> Condition:
    """A condition as users name it."""
    reward, *words = text.split(":")
    ends = [word for word in words if word in ENDS]
    others = tuple(word for word in words if word not in ENDS)
    return Condition(reward, cast("End", ends[0] if ends else DEFAULT_END), others)


def trained(study: Study, condition: Condition) -> list[RunDirectory]:
    """The runs of a condition that are trained to their end."""
    configurations = [
        configure(
            study.environment,
            reward=condition.reward,
            end=condition.end,
            algorithm=study.algorithm,
            environment_options=parse_settings(study.env, "--env"),
            settings=condition.settings,
            steps=study.steps,
            evaluation_interval=study.interval,
            seed=seed,
        )
        for seed in range(study.first_seed, study.first_seed + study.seeds)
    ]
    planned = plan(configurations, study.out)
    runs = prepare(planned, study.out)
    if runs:
        with GridProgress(console(), planned) as progress:
            outcomes = train_population(runs, progress, workers=min(study.workers, len(runs)))
        if any(outcome.state == "interrupted" for outcome in outcomes):
            raise KeyboardInterrupt
    return [entry.run for entry in planned if _is_complete(entry.run)]


def _is_complete(run: RunDirectory) -> bool:
    return run.policy_step("last") >= run.configuration.steps


def assessed(run: RunDirectory, name: str, count: int) -> Found:
    """The row of a run's last policy, and its learning curve."""
    configuration = run.configuration
    episodes = evaluate(
        lambda: make_configured(configuration),
        load_policy(run, "last"),
        episode_seeds(FINAL_SEEDS, count),
    )
    summary = summarise([episode.assessment for episode in episodes])
    curve = list(_curve(run))
    reached = steps_to([point["step"] for point in curve], [point["S+T"] for point in curve])
    row = {
        "condition": name,
        "seed": configuration.seed,
        "steps": configuration.steps,
        "S": summary.safe,
        "S+T": summary.safe_target,
        "S+T+C": summary.safe_target_comfort,
        "PAM": summary.pam,
        "steps to 0.9": "" if reached is None else reached,
        **summary.requirements,
    }
    named = [{"condition": name, "seed": configuration.seed, **point} for point in curve]
    return Found(row, named)


def _curve(run: RunDirectory) -> Iterator[dict[str, Any]]:
    rows = run.evaluations()
    for step in sorted({row["step"] for row in rows}):
        pam = np.array([row["pam"] for row in rows if row["step"] == step])
        yield {
            "step": int(step),
            "PAM": float(pam.mean()),
            "S": float((pam >= 1.0).mean()),
            "S+T": float((pam >= 1.5).mean()),
            "S+T+C": float(np.mean(accomplished_comfort(pam))),
        }


def write(file: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Replace rows of a table, by condition and seed."""
    new = {(row["condition"], str(row["seed"])) for row in rows}
    kept = [row for row in read(file) if (row["condition"], row["seed"]) not in new]
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows([*kept, *({k: _short(v) for k, v in row.items()} for row in rows)])


def _short(value: Any) -> Any:
    return f"{value:.5g}" if isinstance(value, float | np.floating) else value


def read(file: Path) -> list[dict[str, str]]:
    """The rows of a table; none if it does not exist."""
    if not file.exists():
        return []
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def print_table(rows: Sequence[dict[str, str]]) -> None:
    """The table of docs/benchmarks.md."""
    print("| reward | S | S+T | seeds below 0.5 | IQM | 95 % of the mean | S+T+C | steps to 0.9 |")
    print("|---|---|---|---|---|---|---|---|")
    for name in dict.fromkeys(row["condition"] for row in rows):
        own = [row for row in rows if row["condition"] == name]
        column = {key: np.array([float(row[key]) for row in own]) for key in ("S", "S+T", "S+T+C")}
        target = column["S+T"]
        low, high = interval(target)
        reached = sorted(float(row["steps to 0.9"] or "inf") for row in own)
        middle = float(np.median(reached))
        never = sum(not row["steps to 0.9"] for row in own)
        if np.isinf(middle):
            took = "never" + (
                f" (median; {len(own) - never} of {len(own)} do)" if never < len(own) else ""
            )
        else:
            took = f"{middle:,.0f}" + (f" ({never} of {len(own)} never)" if never else "")
        print(
            f"| {name} | {column['S'].mean():.2f} | {target.mean():.2f} | {failed_seeds(target)} "
            f"| {float(interquartile_mean(target)):.2f} | {low:.2f} to {high:.2f} "
            f"| {column['S+T+C'].mean():.2f} | {took} |"
        )


def main(study: Study) -> None:
    """Run the study."""
    folder = study.folder
    policies, curves = folder / "policies.csv", folder / "curves.csv"
    for text in () if study.tables_only else study.conditions:
        condition = parsed(text)
        runs = trained(study, condition)
        arguments = [runs, [condition.name] * len(runs), [study.episodes] * len(runs)]
        with ProcessPoolExecutor(study.workers, mp_context=get_context("spawn")) as pool:
            found = list(pool.map(assessed, *arguments))
        write(policies, [one.row for one in found])
        write(curves, [point for one in found for point in one.curve])
        (folder / "configurations").mkdir(exist_ok=True)
        kept = folder / "configurations" / f"{condition.name.replace(' ', '-')}.json"
        own = [row for row in read(policies) if row["condition"] == condition.name]
        seeds = sorted(int(row["seed"]) for row in own)
        content = {**runs[0].configuration.to_json(), "seed": seeds}
        kept.write_text(json.dumps(content, indent=1) + "\n")
        if condition.reward in study.keep:
            for run in runs:
                name = f"{condition.name.replace(' ', '-')}-seed-{run.configuration.seed}.bundle"
                shutil.copy(run.policy_file("last"), folder / name)
        print_table(own)
    print_table(read(policies))


if __name__ == "__main__":
    main(tyro.cli(Study, description=__doc__))
