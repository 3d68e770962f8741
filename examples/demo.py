"""Trains a policy for a task, assesses it, draws its learning curve and films it.

Examples:
  python examples/demo.py                             # a car that drives a lap: make demo
  python examples/demo.py hprs/CartPole-v0            # a cart pole: make demo-cartpole
  python examples/demo.py --const speed_max=2.4 --const speed_min=1.5 --out runs/slow
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np
import tyro

from hprs.cli.console import console
from hprs.cli.evaluate import Evaluate
from hprs.cli.inputs import Constants
from hprs.cli.measures_table import print_measures, print_notes
from hprs.cli.progress import TrainingProgress
from hprs.errors import HprsError
from hprs.explanation.episode import record
from hprs.explanation.explanation import explain
from hprs.explanation.film import VIDEO
from hprs.explanation.video import write_video
from hprs.spec.parameters import parse_constants
from hprs.training.configure import configure
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
from hprs.training.measures import measures
from hprs.training.policies import RandomPolicy, do_nothing
from hprs.training.run_directory import RunDirectory, create_runs
from hprs.training.trained import load_policy
from hprs.training.trainers import trainer_of

if TYPE_CHECKING:
    from hprs.training.run_directory import Which
    from hprs.wrappers.single import TaskWrapper

WHICH = cast("Which", Evaluate.which)
"""The policy that is assessed and filmed: what `hprs evaluate` assesses too."""
FILM_SIZE = (480, 360)
"""Width and height of the scene in the film at most, in pixels."""
NEAR = ("hprs/SafeDriving-v0", "hprs/FollowLeader-v0")
"""Environments that are filmed from near, around the car."""


@dataclass(frozen=True)
class Demo:
    """Train, assess, draw and film."""

    environment: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="ENV")] = NEAR[0]
    """What the policy is for."""
    task: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Another task for it; default: the benchmark's own."""
    constants: Constants = ()
    seed: int = 0
    """Seed of the training."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Environment steps of the training; default: what the benchmark needs."""
    episodes: int = 50
    """Episodes of the assessment."""
    out: Path = Path("runs/demo")
    """Folder of the results; what an earlier demo left there is replaced."""


def main(demo: Demo) -> None:
    """Run the demo."""
    start = time.monotonic()
    configuration = configure(
        demo.environment,
        task_path=demo.task,
        constants=parse_constants(demo.constants),
        steps=demo.steps,
        seed=demo.seed,
    )
    training = demo.out / "training"
    shutil.rmtree(training, ignore_errors=True)
    [run] = create_runs([configuration], training)
    print("The task:\n")
    print("\n".join(f"    {line}" for line in configuration.task_text.strip().splitlines()))
    print()
    if not trainer_of(configuration)(run, TrainingProgress(console())):
        sys.exit(130)
    trained = time.monotonic() - start
    print()
    assess(run, demo.episodes)
    curve = draw_learning_curve(run, demo.out / "learning_curve.png")
    episode = film_episode(run, demo.out / "episode.gif")
    print()
    print(f"Learning curve: {curve}")
    print(f"One episode:    {episode}")
    print(f"Run directory:  {run.path}")
    print(f"Assess again:   hprs evaluate {run.path}")
    print(f"Trained in {trained:.0f} s, done in {time.monotonic() - start:.0f} s.")


def assess(run: RunDirectory, count: int) -> None:
    """Assess the trained policy on episodes that the training has not seen, and print the table."""
    configuration = run.configuration
    task, seeds = configuration.task, episode_seeds(FINAL_SEEDS, count)

    def episodes(policy: Any) -> list[Any]:
        found = evaluate(lambda: make_configured(configuration), policy, seeds)
        return [episode.assessment for episode in found]

    environment = make_configured(configuration)
    space = environment.action_space
    environment.close()
    floors = {
        "doing nothing": episodes(do_nothing(space)),
        "random": episodes(RandomPolicy(space, seed=0)),
    }
    assessments = episodes(load_policy(run, WHICH))
    print_measures(
        f"The {WHICH} policy of the training, {count} episodes:",
        task,
        measures(task, assessments),
        floors={
            name: {key: value.value for key, value in measures(task, floor).items()}
            for name, floor in floors.items()
        },
    )
    print_notes(assessments, several=False)


def draw_learning_curve(run: RunDirectory, path: Path) -> Path:
    """Draw every requirement and PAM over the training's steps."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    configuration, rows = run.configuration, run.evaluations()
    steps = np.array(sorted({row["step"] for row in rows}))

    def means(column: str) -> Any:
        return [np.mean([row[column] for row in rows if row["step"] == step]) for step in steps]

    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 6), sharex=True, layout="constrained")
    upper.plot(steps, means("pam"), color="black")
    for level, meaning in ((1.0, "safe"), (1.5, "safe and on target")):
        upper.axhline(level, color="grey", linewidth=0.8, linestyle=":")
        upper.annotate(
            meaning, (steps[-1], level), (-2, 2), textcoords="offset points", fontsize=8, ha="right"
        )
    title = f"{configuration.environment}, seed {configuration.seed}"
    upper.set(ylabel="PAM", ylim=(0, 1.8), title=title)
    for requirement in configuration.task.requirements:
        column = f"{requirement.kind}.{requirement.label}"
        lower.plot(steps, means(column), label=f"{requirement.kind} {requirement.label}")
    lower.set(xlabel="environment steps", ylabel="met (fraction)", ylim=(-0.05, 1.05))
    lower.xaxis.set_major_formatter("{x:,.0f}")
    figure.legend(fontsize=8, ncols=4, loc="outside lower center")
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


def film_episode(run: RunDirectory, path: Path) -> Path:
    """Film one episode, with the state of every requirement beside the scene."""
    # Pygame draws into memory; no window is needed.
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    configuration = run.configuration
    camera = {"camera": "follow"} if configuration.environment in NEAR else {}

    def make(**options: Any) -> TaskWrapper:
        return make_configured(configuration, **camera, **options)

    played = record(make, load_policy(run, WHICH), FINAL_SEEDS, replace(VIDEO, size=FILM_SIZE))
    write_video(explain(configuration.task, played.trace, rate=played.rate), played.film, path)
    return path


if __name__ == "__main__":
    try:
        main(tyro.cli(Demo, description=__doc__))
    except HprsError as error:
        print(error, file=sys.stderr)
        sys.exit(1)
