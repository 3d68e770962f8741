"""Learning curves of our trainers beside those of Stable-Baselines3's, with the same settings.

    .venv/bin/python benchmarks/against_sb3.py ppo                 # trains what is missing
    .venv/bin/python benchmarks/against_sb3.py sac --tables-only

Environments under their own rewards, seeds 0 to 9 of each trainer. Compared are the return of the
last evaluation and the area under the curve of all evaluations, by interquartile means over seeds:
the 95 % bootstrap interval of their difference, for which the seeds of both are drawn again, shall
lie within 10 % of the range from a random policy to the best return. Writes
results/ALGORITHM/against_sb3.csv and docs/pictures/ALGORITHM_against_sb3.png.
"""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

import _pendulum  # noqa: F401
import numpy as np
import tyro

from hprs.experiments.statistics import difference_interval, interquartile_mean, interval

ROOT = Path(__file__).parent.parent
ANYTHING = "signal first = obs[0] in [-10, 10]\nencourage anything: first <= 10\n"
"""A task that ends no episode; the reward `env` does not look at it."""
EVALUATIONS, EPISODES = 25, 20
MARGIN = 0.1
"""Of the range from random to best."""
TRAINERS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    # What the one does and the other does not.
    "ppo": {"jax": {"normalize_observations": False, "critic_signals": False}, "sb3": {}},
    "sac": {"jax": {"overlap": False}, "sb3": {}},
}
COLOURS = {"jax": ("#0072b2", "hprs, JAX"), "sb3": ("#d55e00", "Stable-Baselines3")}
"""Of Okabe and Ito's palette."""

Curves: TypeAlias = dict[str, dict[int, tuple[np.ndarray, np.ndarray]]]
"""Trainer to seed to the steps of evaluations and their mean returns."""


@dataclass(frozen=True)
class Contest:
    """What is learned, and with what."""

    environment: str
    steps: int
    best: float
    """Return that cannot be, or hardly ever is, surpassed."""
    settings: Mapping[str, Any]


# Our PPO scales actions to [-1, 1], theirs does not: with the same deviation it would explore
# twice as far.
PENDULUM = "_pendulum:ScaledPendulum-v1"
_OF_PPO: Mapping[str, Any] = {
    "batch_size": 256,
    "n_epochs": 10,
    "ent_coef": 0.0,
    "scale_reward": True,
    "net_arch": [64, 64],
}
CONTESTS: Mapping[str, Mapping[str, Contest]] = {
    "ppo": {
        "CartPole-v1": Contest(
            "CartPole-v1",
            steps=100_000,
            best=500.0,
            settings={
                **_OF_PPO,
                "environments": 8,
                "n_steps": 128,
                "learning_rate": 1e-3,
                "gamma": 0.98,
                "gae_lambda": 0.9,
            },
        ),
        "Pendulum-v1": Contest(
            PENDULUM,
            steps=200_000,
            best=-150.0,
            settings={
                **_OF_PPO,
                "environments": 16,
                "n_steps": 64,
                "learning_rate": "linear_0.001",
                "gamma": 0.9,
                "gae_lambda": 0.95,
            },
        ),
    },
    "sac": {
        "Pendulum-v1": Contest(
            PENDULUM,
            steps=10_000,
            best=-150.0,
            settings={
                "environments": 1,
                "net_arch": [64, 64],
                "learning_rate": 1e-3,
                "learning_starts": 500,
                "buffer_size": 10_000,
                "ent_coef": "auto",
            },
        ),
    },
}


@dataclass(frozen=True)
class Against:
    """Train, compare, draw."""

    algorithm: tyro.conf.Positional[Literal["ppo", "sac"]]
    """Whose trainers are compared."""
    seeds: int = 10
    """Of each trainer, from 0 on."""
    workers: int = 2
    """Processes side by side."""
    out: Path = Path("runs/against_sb3")
    """Where run directories are made."""
    tables_only: bool = False
    """Train nothing: compare what the table holds."""

    @property
    def table(self) -> Path:
        """The file of all evaluations."""
        return ROOT / "results" / self.algorithm / "against_sb3.csv"

    @property
    def picture(self) -> Path:
        """The file of the picture."""
        return ROOT / "docs" / "pictures" / f"{self.algorithm}_against_sb3.png"


def train(arguments: Against) -> None:
    """Train what is missing, and write the table of all evaluations."""
    from rich.console import Console

    from hprs.cli.population_progress import PopulationProgress
    from hprs.training.population import train_population
    from hprs.training.run_directory import RunDirectory, create_runs, folder_of

    rows: list[tuple[str, str, int, int, str]] = []
    for name, contest in CONTESTS[arguments.algorithm].items():
        for trainer in COLOURS:
            configurations = [
                configuration_of(arguments.algorithm, contest, trainer, seed)
                for seed in range(arguments.seeds)
            ]
            paths = [folder_of(one, arguments.out) / f"seed-{one.seed}" for one in configurations]
            new = [
                one for one, path in zip(configurations, paths, strict=True) if not path.exists()
            ]
            if new:
                create_runs(new, arguments.out)
            runs = [RunDirectory(path) for path in paths]
            with PopulationProgress(Console(), runs, arguments.workers) as progress:
                outcomes = train_population(runs, progress, workers=arguments.workers)
            if any(outcome.state != "complete" for outcome in outcomes):
                raise SystemExit("stopped; the same command goes on")
            for run in runs:
                for step, mean in evaluations(run.path / "evaluations.csv"):
                    seed = run.configuration.seed
                    rows.append((name, trainer, seed, step, f"{mean:.2f}"))
    arguments.table.parent.mkdir(parents=True, exist_ok=True)
    with arguments.table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("environment", "trainer", "seed", "step", "return"))
        writer.writerows(rows)


def configuration_of(algorithm: str, contest: Contest, trainer: str, seed: int) -> Any:
    """One training."""
    from hprs.training.configure import configure

    with tempfile.TemporaryDirectory() as folder:
        task = Path(folder, "anything.hprs")
        task.write_text(ANYTHING, encoding="utf-8")
        return configure(
            contest.environment,
            task_path=str(task),
            reward="env",
            algorithm=algorithm,
            trainer=trainer,
            settings={**contest.settings, **TRAINERS[algorithm][trainer]},
            steps=contest.steps,
            evaluation_interval=contest.steps // EVALUATIONS,
            evaluation_episodes=EPISODES,
            seed=seed,
        )


def evaluations(path: Path) -> list[tuple[int, float]]:
    """Steps and mean returns of the evaluations of a run."""
    found: dict[int, list[float]] = {}
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            found.setdefault(int(row["step"]), []).append(float(row["return"]))
    return [(step, float(np.mean(totals))) for step, totals in found.items()]


def read(table: Path, name: str) -> Curves:
    """The curves of an environment, from the table."""
    points: dict[str, dict[int, list[tuple[int, float]]]] = {trainer: {} for trainer in COLOURS}
    with table.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["environment"] == name:
                curve = points[row["trainer"]].setdefault(int(row["seed"]), [])
                curve.append((int(row["step"]), float(row["return"])))
    return {
        trainer: {
            seed: tuple(np.array(list(zip(*curve, strict=True)))) for seed, curve in of.items()
        }
        for trainer, of in points.items()
    }


def random_return(contest: Contest) -> float:
    """Mean return of actions drawn uniformly, over 200 episodes."""
    import gymnasium as gym

    environment = gym.make(contest.environment)
    environment.action_space.seed(0)
    totals: list[float] = []
    for seed in range(200):
        environment.reset(seed=seed)
        total, ended = 0.0, False
        while not ended:
            _, reward, terminated, truncated, _ = environment.step(
                environment.action_space.sample()
            )
            total, ended = total + float(reward), terminated or truncated
        totals.append(total)
    environment.close()
    return float(np.mean(totals))


def area(steps: np.ndarray, returns: np.ndarray) -> float:
    """Mean height of a curve between its first step and its last."""
    return float(np.trapezoid(returns, steps) / (steps[-1] - steps[0]))


def difference(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float, float]:
    """Of the interquartile means, with its 95 % bootstrap interval."""
    low, high = difference_interval(ours, theirs)
    return float(interquartile_mean(ours) - interquartile_mean(theirs)), low, high


def print_table(arguments: Against) -> None:
    """Print what docs/benchmarks.md shows."""
    print("| | JAX | SB3 | difference, % of the range | within 10 % |\n|---|---|---|---|---|")
    for name, contest in CONTESTS[arguments.algorithm].items():
        bottom, curves = random_return(contest), read(arguments.table, name)
        span = contest.best - bottom
        for what, measure in (
            ("final return", lambda steps, returns: float(returns[-1])),
            ("area under the curve", area),
        ):
            ours, theirs = (
                np.array([measure(*curve) for curve in curves[trainer].values()])
                for trainer in ("jax", "sb3")
            )
            middle, low, high = (100 * one / span for one in difference(ours, theirs))
            verdict = "yes" if low >= -100 * MARGIN and high <= 100 * MARGIN else "no"
            print(
                f"| {name}, {bottom:.0f} to {contest.best:.0f}: {what} "
                f"| {interquartile_mean(ours):.1f} | {interquartile_mean(theirs):.1f} "
                f"| {middle:+.1f} [{low:+.1f}, {high:+.1f}] | {verdict} |"
            )


def draw(arguments: Against) -> None:
    """Draw both curves: means over seeds, and their 95 % bootstrap intervals."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = list(CONTESTS[arguments.algorithm])
    size = (5 * len(names), 3.6)
    figure, all_axes = plt.subplots(
        1, len(names), figsize=size, layout="constrained", squeeze=False
    )
    axes = all_axes[0]
    for axis, name in zip(axes, names, strict=True):
        for trainer, curves in read(arguments.table, name).items():
            steps = next(iter(curves.values()))[0]
            heights = np.stack([np.interp(steps, *curve) for curve in curves.values()])
            colour, label = COLOURS[trainer]
            low, high = interval(heights.T)
            axis.fill_between(steps, low, high, color=colour, alpha=0.25, linewidth=0)
            dashes = "-" if trainer == "jax" else "--"
            axis.plot(steps, heights.mean(0), dashes, color=colour, label=label)
        axis.set(title=name, xlabel="environment steps", ylabel="return of an evaluation")
        axis.xaxis.set_major_formatter(lambda step, _: f"{step / 1000:g}k")
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].legend(frameon=False, loc="lower right")
    figure.savefig(arguments.picture, dpi=110)


if __name__ == "__main__":
    # PyTorch here, in Stable-Baselines3's workers one thread each, as `hprs train` has it.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    chosen = tyro.cli(Against)
    if not chosen.tables_only:
        train(chosen)
    print_table(chosen)
    draw(chosen)
