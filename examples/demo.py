"""Trains a policy for the cart-pole task, assesses it, draws its learning curve and films it.

Run by `make demo`. Edit a constant in the task file and run it again with --task.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np
import tyro

from hprs.cli.console import console
from hprs.cli.evaluate import Evaluate
from hprs.cli.measures_table import print_measures, print_notes
from hprs.cli.progress import TrainingProgress
from hprs.errors import HprsError
from hprs.training import sb3
from hprs.training.configure import configure
from hprs.training.environment import make_configured
from hprs.training.evaluation import FINAL_SEEDS, episode_seeds, evaluate
from hprs.training.measures import measures
from hprs.training.policies import RandomPolicy, do_nothing
from hprs.training.run_directory import RunDirectory, create_runs

if TYPE_CHECKING:
    from PIL import Image

    from hprs.spec.task import Task
    from hprs.training.run_directory import Which

ENVIRONMENT = "hprs/CartPole-v0"
WHICH = cast("Which", Evaluate.which)
"""The policy that is assessed and filmed: what `hprs evaluate` assesses too."""
FRAME_EVERY = 4
"""Steps between two frames of the film."""
FILM_SIZE = (400, 200)
"""Width and height of the scene in the film, in pixels."""
MET, VIOLATED = (32, 128, 64), (192, 48, 40)


@dataclass(frozen=True)
class Demo:
    """Train, assess, draw and film."""

    task: Annotated[str | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Another task for the cart pole; default: the benchmark's own."""
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
        ENVIRONMENT, task_path=demo.task, steps=demo.steps, seed=demo.seed, trainer="sb3"
    )
    trained = demo.out / "training"
    shutil.rmtree(trained, ignore_errors=True)
    [run] = create_runs([configuration], trained)
    out = console()
    print("The task:\n")
    print("\n".join(f"    {line}" for line in configuration.task_text.strip().splitlines()))
    print()
    if not sb3.train(run, TrainingProgress(out)):
        sys.exit(130)
    print()
    assess(run, demo.episodes)
    curve = draw_learning_curve(run, demo.out / "learning_curve.png")
    film = film_episode(run, demo.out / "episode.gif")
    print()
    print(f"Learning curve: {curve}")
    print(f"One episode:    {film}")
    print(f"Run directory:  {run.path}")
    print(f"Assess again:   hprs evaluate {run.path}")
    print(f"Done in {time.monotonic() - start:.0f} s.")


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
    assessments = episodes(sb3.load_policy(run, WHICH))
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

    rows = run.evaluations()
    steps = np.array(sorted({row["step"] for row in rows}))

    def means(column: str) -> Any:
        return [np.mean([row[column] for row in rows if row["step"] == step]) for step in steps]

    figure, (upper, lower) = plt.subplots(2, 1, figsize=(7, 6), sharex=True, layout="constrained")
    upper.plot(steps, means("pam"), color="black")
    for level, meaning in ((1.0, "safe"), (1.5, "safe and on target")):
        upper.axhline(level, color="grey", linewidth=0.8, linestyle=":")
        upper.annotate(meaning, (steps[0], level), (2, 2), textcoords="offset points", fontsize=8)
    upper.set(ylabel="PAM", ylim=(0, 1.8), title=f"{ENVIRONMENT}, seed {run.configuration.seed}")
    for requirement in run.configuration.task.requirements:
        column = f"{requirement.kind}.{requirement.label}"
        lower.plot(steps, means(column), label=f"{requirement.kind} {requirement.label}")
    lower.set(xlabel="environment steps", ylabel="met (fraction)", ylim=(-0.05, 1.05))
    lower.legend(fontsize=8)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return path


def film_episode(run: RunDirectory, path: Path) -> Path:
    """Film one episode, with the state of every requirement below the scene."""
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    policy = sb3.load_policy(run, WHICH)
    environment = make_configured(run.configuration, render_mode="rgb_array")
    task = run.configuration.task
    observation, info = environment.reset(seed=FINAL_SEEDS)
    frames, step, ended = [_frame(environment, task, info, 0)], 0, False
    while not ended:
        observation, _, terminated, truncated, info = environment.step(policy(observation))
        step, ended = step + 1, terminated or truncated
        if step % FRAME_EVERY == 0 or ended:
            frames.append(_frame(environment, task, info, step))
    environment.close()
    # 50 steps a second; viewers show nothing faster than 20 ms a frame.
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=[20 * FRAME_EVERY] * (len(frames) - 1) + [1500],
        loop=0,
        optimize=True,
    )
    return path


def _frame(environment: Any, task: Task, info: dict[str, Any], step: int) -> Image.Image:
    from PIL import Image, ImageDraw

    scene = Image.fromarray(environment.render())
    scene = scene.crop((0, scene.height - scene.width // 2 - 50, scene.width, scene.height - 50))
    line, margin = 14, 6
    height = line * (len(task.requirements) + 1) + 2 * margin
    frame = Image.new("RGB", (FILM_SIZE[0], FILM_SIZE[1] + height), "white")
    frame.paste(scene.resize(FILM_SIZE), (0, 0))
    draw = ImageDraw.Draw(frame)
    if "mark" in task.ranges:
        # Gymnasium draws 4.8 m over the whole width.
        x = round(FILM_SIZE[0] * (0.5 + task.ranges["mark"].low / 4.8))
        draw.polygon(((x, 170), (x - 6, 182), (x + 6, 182)), fill=MET)
    y = FILM_SIZE[1] + margin
    draw.text((margin, y), f"step {step}   potential {info['potential']:.2f}", fill="black")
    for row, requirement in enumerate(task.requirements, start=1):
        margin_here = info["margins"][requirement.label]
        met = margin_here >= 0.0
        words = (requirement.kind, requirement.label, f"margin {margin_here:+.2f}")
        box = (margin, y + row * line + 2, margin + 8, y + row * line + 10)
        draw.rectangle(box, fill=MET if met else VIOLATED)
        for word, x in zip(words, (margin + 14, 100, 180), strict=True):
            draw.text((x, y + row * line), word, fill=MET if met else VIOLATED)
    return frame.quantize(32)


if __name__ == "__main__":
    try:
        main(tyro.cli(Demo, description=__doc__))
    except HprsError as error:
        print(error, file=sys.stderr)
        sys.exit(1)
