"""How long `hprs report` takes over many runs, and how much memory: the first time, and again.

    .venv/bin/python benchmarks/report.py
    .venv/bin/python benchmarks/report.py --runs 200

Makes synthetic runs of all benchmarks but the hardcore walker: 10 seeds each, 100 evaluations of 10
episodes, with their TensorBoard files.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import tyro

from hprs.training import files
from hprs.training.configure import configure
from hprs.training.events import EventWriter
from hprs.training.run_directory import EVALUATIONS_FILE, RunDirectory, create_runs

ENVIRONMENTS = ("SafeDriving", "FollowLeader", "LunarLanderObstacle", "BipedalWalker", "CartPole")
SEEDS, EVALUATIONS, EPISODES = 10, 100, 10


def main(runs: int = 2_000) -> None:
    """Make the runs, report them twice, and print what it took.

    Args:
        runs: How many.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        groups = runs // (SEEDS * len(ENVIRONMENTS))
        for name in ENVIRONMENTS:
            for group in range(groups):
                make(f"hprs/{name}-v0", group, out / "runs")
        for which in ("first", "again"):
            start = time.perf_counter()
            command = [sys.executable, "-m", "hprs", "report", str(out / "runs"), "--no-pictures"]
            subprocess.run(
                [*command, "--out", str(out / "report")], check=True, stdout=subprocess.DEVNULL
            )
            seconds = time.perf_counter() - start
            memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
            page = (out / "report" / "report.html").stat().st_size / 1e6
            print(f"{which}: {seconds:.1f} s, {memory:.2f} GB at most, page {page:.1f} MB")


def make(environment: str, group: int, out: Path) -> None:
    """The seeds of a configuration."""
    configurations = [
        configure(
            environment, steps=1_000_000, seed=seed, settings={"learning_rate": 1e-4 * (1 + group)}
        )
        for seed in range(SEEDS)
    ]
    for run in create_runs(configurations, out):
        _fill(run, np.random.default_rng([group, run.configuration.seed]))


def _fill(run: RunDirectory, generator: np.random.Generator) -> None:
    task = run.configuration.task
    steps = np.repeat(np.linspace(0, run.configuration.steps, EVALUATIONS).astype(int), EPISODES)
    good = generator.random(len(steps)) < steps / steps[-1]
    pam = np.where(good, 1.5 + 0.25 * generator.random(len(steps)), 0.1)
    labels = len(task.requirements)
    columns: Sequence[np.ndarray] = (
        steps, np.arange(len(steps)), np.full(len(steps), 200), generator.random(len(steps)), pam,
        good, good, *(np.where(good, 1.0, 0.0) for _ in range(labels)),
    )  # fmt: skip
    rows = "".join(
        ",".join(f"{value:g}" for value in row) + "\n" for row in zip(*columns, strict=True)
    )
    file = run.path / EVALUATIONS_FILE
    files.replace(file, file.read_bytes() + rows.encode())
    with EventWriter(run) as events:
        for step in np.unique(steps):
            events.write({"assessment/S": 1.0}, int(step))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
