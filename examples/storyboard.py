r"""Draws an episode as a row of pictures, with the state of every requirement below each.

A file that ends in .gif becomes a film of all steps instead, in its true time.

Examples:
  python examples/storyboard.py hprs/CartPole-v0 --policy random --out picture.png
  python examples/storyboard.py runs/hprs-CartPole-v0/hprs-ppo-1a2b3c4d/seed-0 --out picture.png
  python examples/storyboard.py hprs/BipedalWalker-v0 --policy zero --env goal=40 --out picture.png
  python examples/storyboard.py hprs/SafeDriving-v0 --out picture.png \
    --policy results/policies/safe-driving/policy.bundle
  python examples/storyboard.py hprs/FollowLeader-v0 --policy pursuit --out film.gif

The pages in docs/environments say which command made theirs.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from hprs.errors import HprsError, UsageError
from hprs.spec.task import Task
from hprs.training import files
from hprs.training.algorithms import parse_settings
from hprs.training.environment import check_options, find_task, make_environment, require
from hprs.training.evaluation import FINAL_SEEDS
from hprs.training.policies import Policy, named_policy
from hprs.training.run_directory import Which, find_runs

if TYPE_CHECKING:
    from PIL import Image

    from hprs.wrappers.single import TaskWrapper

COLUMNS = 4
"""Pictures side by side, at most."""
WIDTHS = range(100, 2000)
"""Of the scene in a picture, in pixels."""
FRAMES_A_SECOND = 12.5
"""Of a film, at most."""
LAST_FRAME = 1500
"""How long a film shows its end, in ms."""
GAP = 6
LINE = 17
"""Height of a line of text, in pixels."""
LABELS_IN_A_LINE = 3
MET, VIOLATED = (32, 128, 64), (192, 48, 40)


@dataclass(frozen=True)
class Storyboard:
    """Draw an episode as a row of pictures."""

    subject: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="RUN|ENV")]
    """Run directory; with --policy, an environment."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """Where the picture goes."""
    policy: Annotated[str | None, tyro.conf.arg(metavar="POLICY", help_behavior_hint="")] = None
    """zero, random, a bundle, an SB3 .zip, module:function, or, of a car, pursuit."""
    which: Which = "last"
    """The policy of a run."""
    options: Annotated[
        tyro.conf.UseAppendAction[tuple[str, ...]],
        tyro.conf.arg(name="env", metavar="KEY=VALUE"),
    ] = ()
    """An option of the environment, as its constructor names it; default: as trained."""
    horizon: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """End the episode after this many steps; default: as trained, or as registered."""
    seed: Annotated[int, tyro.conf.arg(metavar="N")] = FINAL_SEEDS
    """Seed of the episode."""
    pictures: Annotated[int, tyro.conf.arg(metavar="N")] = 8
    """How many, at even distances from the first step to the last."""
    steps: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N", help_behavior_hint="")] = ()
    """Show these steps instead."""
    width: Annotated[int, tyro.conf.arg(metavar="N")] = 300
    """Of the scene in a picture, in pixels; its height is two thirds of that."""


@dataclass(frozen=True)
class Moment:
    """What is shown of one step."""

    step: int
    scene: Image.Image
    margins: Mapping[str, float]


def main(storyboard: Storyboard) -> None:
    """Play the episode and draw it."""
    require("PIL", "report")
    if not storyboard.out.parent.is_dir():
        raise UsageError(f"there is no folder '{storyboard.out.parent}' for the picture.")
    if storyboard.width not in WIDTHS:
        raise UsageError(f"--width is a number of pixels from 100 on, not {storyboard.width}.")
    # Pygame draws into memory; no window is needed.
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    environment, policy = make(storyboard)
    moments = play(environment, policy, storyboard.seed, storyboard.width)
    last = len(moments) - 1
    if storyboard.out.suffix == ".gif":
        film(moments, environment.metadata["render_fps"], storyboard.out)
        print(f"{storyboard.out}: {last} steps")
        return
    count = max(storyboard.pictures, 2)
    steps = storyboard.steps or [round(i * last / (count - 1)) for i in range(count)]
    if not all(0 <= step <= last for step in steps):
        raise UsageError(f"the episode has the steps 0 to {last}; --steps asks for {steps}.")
    picture = io.BytesIO()
    draw([moments[step] for step in steps]).save(picture, format="png", optimize=True)
    with files.writing(storyboard.out):
        storyboard.out.write_bytes(picture.getvalue())
    print(f"{storyboard.out}: steps {', '.join(map(str, steps))} of {last}")


def make(storyboard: Storyboard) -> tuple[TaskWrapper, Policy]:
    """The environment with its task, and the policy."""
    options = parse_settings(storyboard.options, "--env")
    if storyboard.policy is None:
        from hprs.training.trained import load_policy

        runs = find_runs(Path(storyboard.subject))
        if len(runs) > 1:
            raise UsageError(
                f"'{storyboard.subject}' holds {len(runs)} seeds; name one, as in {runs[0].path}"
            )
        configuration = runs[0].configuration
        environment = make_drawable(
            configuration.environment,
            configuration.task,
            {**configuration.environment_options, **options},
            storyboard.horizon or configuration.horizon,
        )
        return environment, load_policy(runs[0], storyboard.which)
    task, _ = find_task(storyboard.subject)
    environment = make_drawable(storyboard.subject, task, options, storyboard.horizon)
    if storyboard.policy == "pursuit":
        from pursuit import Pursuit

        return environment, Pursuit(environment)
    return environment, named_policy(storyboard.policy, environment)


def make_drawable(
    name: str, task: Task, options: Mapping[str, Any], horizon: int | None
) -> TaskWrapper:
    """An environment that gives pictures."""
    check_options(name, options)
    return make_environment(
        name, task, "sparse", horizon=horizon, render_mode="rgb_array", **options
    )


def play(environment: TaskWrapper, policy: Policy, seed: int, width: int) -> list[Moment]:
    """Every moment of an episode, the reset's first."""
    from PIL import Image

    def moment(info: Mapping[str, Any]) -> Moment:
        scene: Any = environment.render()
        size = (width, width * 2 // 3)
        return Moment(len(moments), Image.fromarray(scene).resize(size), info["margins"])

    moments: list[Moment] = []
    observation, info = environment.reset(seed=seed)
    moments.append(moment(info))
    ended = False
    while not ended:
        observation, _, terminated, truncated, info = environment.step(policy(observation))
        moments.append(moment(info))
        ended = terminated or truncated
    environment.close()
    return moments


def film(moments: Sequence[Moment], steps_a_second: int, path: Path) -> None:
    """All moments, or every second, third ... of them and the last one, one after the other."""
    every = max(1, round(steps_a_second / FRAMES_A_SECOND))
    shown = [*moments[:-1:every], moments[-1]]
    frames = [draw([moment]) for moment in shown]
    durations = [round(1000 * every / steps_a_second)] * (len(frames) - 1) + [LAST_FRAME]
    data = io.BytesIO()
    frames[0].save(
        data, format="gif", save_all=True, append_images=frames[1:], duration=durations, loop=0
    )
    with files.writing(path):
        path.write_bytes(data.getvalue())


def draw(moments: Sequence[Moment]) -> Image.Image:
    """The moments in rows, from left to right."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(size=13)
    labels, picture = len(moments[0].margins), moments[0].scene.size
    lines = 1 + -(-labels // LABELS_IN_A_LINE)
    width, height = picture[0] + GAP, picture[1] + lines * LINE + 2 * GAP
    rows = -(-len(moments) // COLUMNS)
    columns = -(-len(moments) // rows)
    board = Image.new("RGB", (columns * width + GAP, rows * height + GAP), "white")
    pen = ImageDraw.Draw(board)
    for index, moment in enumerate(moments):
        x, y = GAP + index % columns * width, GAP + index // columns * height
        board.paste(moment.scene, (x, y))
        pen.rectangle((x, y, x + picture[0] - 1, y + picture[1] - 1), outline="grey")
        y += picture[1] + 2
        pen.text((x, y), f"step {moment.step}", fill="black", font=font)
        for place, (label, margin) in enumerate(moment.margins.items()):
            colour = MET if margin >= 0 else VIOLATED
            left = x + place % LABELS_IN_A_LINE * picture[0] // LABELS_IN_A_LINE
            top = y + (1 + place // LABELS_IN_A_LINE) * LINE
            pen.rectangle((left, top + 4, left + 8, top + 12), fill=colour)
            pen.text((left + 13, top), label, fill=colour, font=font)
    # Other methods give no colour to what is small, as a car is.
    return board.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1)


if __name__ == "__main__":
    try:
        main(tyro.cli(Storyboard, description=__doc__))
    except HprsError as error:
        print(error, file=sys.stderr)
        sys.exit(2)
