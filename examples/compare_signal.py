"""Draws one signal of two or more trained policies over the same episode.

    python examples/compare_signal.py RUN RUN --signal speed --out speeds.png

Curves are named by the lines in which their tasks differ.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from hprs.errors import HprsError, UsageError
from hprs.spec.printer import format_task
from hprs.spec.task import Task
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS
from hprs.training.run_directory import RunDirectory, find_runs
from hprs.training.trained import load_policy

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
"""Of Okabe and Ito: told apart by who is colour-blind, too."""


@dataclass(frozen=True)
class Comparison:
    """Draw a signal of several policies."""

    runs: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="RUN")]
    """Runs of one seed each."""
    signal: str
    """What is drawn."""
    out: Path = Path("signal.png")
    """Where the picture goes."""
    seed: int = FINAL_SEEDS
    """Of the episode."""
    episodes: int = 20
    """Of which the mean is printed."""


def main(comparison: Comparison) -> None:
    """Play the episodes and draw the first one."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    runs = [found for path in comparison.runs for found in find_runs(path)]
    if len(runs) > len(COLOURS):
        raise UsageError(f"at most {len(COLOURS)} runs can be told apart, got {len(runs)}.")
    names = differences([run.configuration.task for run in runs])
    figure, axes = plt.subplots(figsize=(7, 2.6), layout="constrained")
    for run, name, colour in zip(runs, names, COLOURS, strict=False):
        seeds = range(comparison.seed, comparison.seed + comparison.episodes)
        played = [play(run, comparison.signal, seed) for seed in seeds]
        rate = make_configured(run.configuration).metadata.get("render_fps", 1)
        axes.plot(np.arange(len(played[0])) / rate, played[0], color=colour, label=name)
        mean = np.mean([values.mean() for values in played])
        print(f"{name}: mean {comparison.signal} {mean:.2f} over {len(played)} episodes")
    unit = next(s.unit for s in runs[0].configuration.task.signals if s.name == comparison.signal)
    axes.set(xlabel="s", ylabel=f"{comparison.signal}{f', {unit}' if unit else ''}")
    axes.grid(alpha=0.3)
    figure.legend(fontsize=8, ncols=2, loc="outside upper center")
    figure.savefig(comparison.out, dpi=110)


def play(run: RunDirectory, signal: str, seed: int) -> Any:
    """The values of a signal in an episode, without the reset's."""
    environment, policy = make_configured(run.configuration), load_policy(run, "last")
    observation, _ = environment.reset(seed=seed)
    values, ended = [], False
    while not ended:
        observation, _, terminated, truncated, _ = environment.step(policy(observation))
        if signal not in environment.signal_values:
            known = ", ".join(environment.signal_values)
            raise UsageError(f"there is no signal '{signal}'; there are {known}.")
        values.append(environment.signal_values[signal])
        ended = terminated or truncated
    environment.close()
    return np.array(values)


def differences(tasks: list[Task]) -> list[str]:
    """The lines of each task that the others do not have; equal tasks are numbered."""
    texts = [[" ".join(line.split()) for line in format_task(task).splitlines()] for task in tasks]
    found: list[str] = []
    for number, own in enumerate(texts):
        others = [line for text in texts if text is not own for line in text]
        lines = [line for line in own if line not in others]
        found.append("; ".join(lines) or f"run {number + 1}")
    return found


if __name__ == "__main__":
    try:
        main(tyro.cli(Comparison, description=__doc__))
    except HprsError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
