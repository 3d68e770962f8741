"""The three end-of-episode conventions on the cart pole, ten seeds each.

    for end in paper invariant released; do
        hprs train hprs/CartPole-v0 --trainer sb3 --end $end --seeds 10 --out runs
    done
    .venv/bin/python benchmarks/ends_of_episode.py runs

Prints a table of what the complete ones recorded; each last policy is assessed on 50 new episodes.
Trainings that are missing are made by the lines above, not here: they take hours, not minutes.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

from hprs.semantics.assessment import summarise
from hprs.training import sb3
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
from hprs.training.run_directory import RunDirectory

ENOUGH = 0.9
"""S+T of an evaluation from which on a policy counts as trained."""


def curve(run: RunDirectory) -> tuple[list[float], list[float]]:
    """Steps of the evaluations, and S+T of each."""
    found: dict[float, list[bool]] = defaultdict(list)
    for row in run.evaluations():
        found[row["step"]].append(row["pam"] >= 1.5)
    return list(found), [float(np.mean(met)) for met in found.values()]


def main() -> None:
    """Print the table."""
    if len(sys.argv) != 2:
        print(f"not measured here:\n{__doc__}")
        return
    runs = [RunDirectory(file.parent) for file in Path(sys.argv[1]).glob("**/run.json")]
    runs = [run for run in runs if run.policy_step("last") >= run.configuration.steps]
    by_end: dict[str, list[RunDirectory]] = defaultdict(list)
    for run in sorted(runs, key=lambda run: run.configuration.seed):
        by_end[run.configuration.end].append(run)
    print(
        "end        seed  first S+T >= 0.9  evaluations below it later      S    S+T  S+T+C    PAM"
    )
    for end, same in by_end.items():
        for run in same:
            steps, met = curve(run)
            first = next((i for i, value in enumerate(met) if value >= ENOUGH), None)
            below = "-" if first is None else f"{np.mean(np.array(met[first:]) < ENOUGH):.2f}"
            reached = "never" if first is None else f"{steps[first]:,.0f}"
            configuration = run.configuration
            episodes = evaluate(
                lambda configuration=configuration: make_configured(configuration),
                sb3.load_policy(run, "last"),
                episode_seeds(FINAL_SEEDS, 50),
            )
            s = summarise([episode.assessment for episode in episodes])
            print(
                f"{end:10} {configuration.seed:4}  {reached:>16}  {below:>26}  "
                f"{s.safe:5.2f}  {s.safe_target:5.2f}  {s.safe_target_comfort:5.2f}  {s.pam:5.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
