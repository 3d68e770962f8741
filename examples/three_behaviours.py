"""Draws three drives round one turn: a crash, a safe but uncomfortable one, and a comfortable one.

The paper's first figure, with the package's own simulator and the safe-driving task's own limits.

Example:
  python examples/three_behaviours.py --out docs/pictures/three_behaviours.png
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
import tyro

from hprs.carsim.actuators import MAX_SPEED_COMMAND, ActuatorParameters
from hprs.carsim.designs import corridor
from hprs.carsim.drivers import PursuitParameters, pursue
from hprs.carsim.race import CONTROL_STEP, Settings
from hprs.carsim.randomisation import ranges
from hprs.carsim.selection import selected
from hprs.carsim.track import Track, stack_tracks
from hprs.envs import task_of
from hprs.envs.driving.simulation import SPEED_CHANGE, Episode, Simulation
from hprs.errors import HprsError, MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hprs.spec.task import Task

BENCHMARK = "hprs/SafeDriving-v0"
STRAIGHT, RADIUS, HALF_WIDTH = 8.0, 2.0, 0.75
"""Of a square track with round corners, m; the first corner is the one that is shown."""
TURN = (STRAIGHT, STRAIGHT + RADIUS * np.pi / 2)
"""Progress at which it starts and ends, m."""
SHOWN = (3.0, 15.5)
"""Progress that is shown, m."""
WINDOW = ((3.4, 11.2), (-1.2, 5.4))
"""The part of the plane that is shown, m."""
STEPS = 70
OUTLINE_EVERY = 5
"""Steps between two pictures of a car."""
INK, FAINT, PAPER = "#262b33", "#7a8088", "#ffffff"
ZONE, IN_ZONE, OUTSIDE = "#d5ece4", "#00805f", "#cd4a00"


@dataclass(frozen=True)
class Picture:
    """Draw three drives round one turn."""

    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("three_behaviours.png")
    """Where the picture goes."""


@dataclass
class Drive:
    """What happened, one entry a step from the reset on."""

    poses: list[Any] = field(default_factory=list)
    """x, y, yaw and the angle of the front wheels."""
    progress: list[float] = field(default_factory=list)
    """m."""
    speed: list[float] = field(default_factory=list)
    """m/s."""
    change: list[float] = field(default_factory=list)
    """Of the steering command."""
    margins: list[dict[str, float]] = field(default_factory=list)
    """Of the task's requirements."""
    crashed: bool = False


Driver = Callable[[Any, float, float], tuple[float, float]]
"""From what the pursuing driver would steer, the last steering and the progress in m to a steering
and a speed command in m/s."""


def too_late(steering: float, last: float, progress: float) -> tuple[float, float]:
    """As fast as the car can, and straight on until the turn has begun."""
    return (steering if progress > TURN[0] + 0.7 else 0.0), MAX_SPEED_COMMAND


def bang_bang(steering: float, last: float, progress: float) -> tuple[float, float]:
    """Left or right, all of the throttle or nearly none, and into the turn too early."""
    slow = TURN[0] - 2.5 < progress < TURN[1] - 0.6
    speed = 1.2 if slow else MAX_SPEED_COMMAND
    if progress < 1:
        return 0.45, speed
    if TURN[0] - 0.9 < progress < TURN[0] + 0.2:
        return 1.0, speed
    # It changes its mind only when it is far off.
    if abs(steering) > 0.1:
        last = float(np.copysign(1.0 if TURN[0] - 1 < progress < TURN[1] else 0.5, steering))
    return last, speed


def gentle(steering: float, last: float, progress: float) -> tuple[float, float]:
    """What the pursuing driver steers, at one speed."""
    return steering, 2.5 / ActuatorParameters.speed_gain


BEHAVIOURS: dict[str, Driver] = {
    "crash": too_late,
    "safe, but uncomfortable": bang_bang,
    "safe and comfortable": gentle,
}


def one_turn() -> Track:
    """The track."""
    angles = np.linspace(0, np.pi / 2, 64, endpoint=False)
    corner = RADIUS * np.stack([np.sin(angles), 1 - np.cos(angles)], axis=1)
    straight = np.stack([np.linspace(0, STRAIGHT, 128, endpoint=False), np.zeros(128)], axis=1)
    side = np.concatenate([straight, corner + np.array([STRAIGHT, 0.0])])
    turn, end = np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([STRAIGHT + RADIUS, RADIUS])
    sides, start, rotation = [], np.zeros(2), np.eye(2)
    for _ in range(4):
        sides.append(start + side @ rotation)
        start, rotation = start + end @ rotation, turn @ rotation
    line = np.concatenate(sides)
    return corridor(line, np.full(len(line), HALF_WIDTH), name="one turn")


reset = jax.jit(lambda simulation, key: simulation.reset(key))
step = jax.jit(lambda simulation, episode, action: simulation.step(episode, action))


@jax.jit
def pursued(simulation: Simulation, episode: Episode) -> Any:
    """The steering of a driver that knows its car."""
    car = jax.tree.map(lambda leaf: leaf[0], episode.world.cars)
    driver = PursuitParameters(
        lookahead=1.1,
        speed_gain=ActuatorParameters.speed_gain,
        steering_gain=ActuatorParameters.steering_gain,
    )
    track = selected(simulation.tracks, episode.track)
    return pursue(car, episode.world.progress[0], track, parameters=driver).steering


def drive(simulation: Simulation, driver: Driver, task: Task) -> Drive:
    """A drive from the start line past the turn, or to the first contact."""
    found = Drive()
    episode, _, signals = reset(simulation, jax.random.key(0))
    length = float(simulation.tracks.length[0])
    for _ in range(STEPS):
        cars = episode.world.cars
        found.poses.append([float(v[0]) for v in (cars.x, cars.y, cars.yaw, cars.steering)])
        found.progress.append(float(signals["progress"]) * length)
        found.speed.append(float(signals["speed"]))
        found.change.append(float(signals["steering"] - signals["last_steering"]))
        found.margins.append(task.margins({name: float(v) for name, v in signals.items()}))
        if found.crashed or found.progress[-1] > SHOWN[1]:
            break
        steering, speed = driver(
            float(pursued(simulation, episode)), float(signals["steering"]), found.progress[-1]
        )
        now = (float(signals["speed_command"]) + 1) / 2 * MAX_SPEED_COMMAND
        action = jnp.array([(speed - now) / SPEED_CHANGE, steering], jnp.float32)
        episode, _, signals, _, _, _ = step(simulation, episode, action)
        found.crashed = bool(signals["collision"])
    return found


def drive_all(task: Task) -> dict[str, Drive]:
    """Every behaviour's drive, of cars that are all alike."""
    settings = Settings(start="grid", ranges=ranges("nominal"))
    tracks = stack_tracks([one_turn()])
    simulation = Simulation(tracks=tracks, settings=settings, horizon=jnp.asarray(STEPS))
    return {name: drive(simulation, driver, task) for name, driver in BEHAVIOURS.items()}


def draw_turn(axes: Axes, ground: Any, found: Drive) -> None:
    """The turn from above with a car every half a second."""
    from matplotlib.patches import Polygon

    from hprs.envs.driving.rendering.canvas import View
    from hprs.envs.driving.rendering.car import car_shapes
    from hprs.envs.driving.rendering.ground import scenery
    from hprs.envs.driving.rendering.picture import COLOURS

    def fill(shapes: Any, layer: int) -> None:
        for points, colour in shapes:
            rgba = [part / 255 for part in (*colour, 255)[:4]]
            axes.add_patch(Polygon(points, facecolor=rgba, linewidth=0, zorder=layer))

    view = View(looks_at=(0.0, 0.0), at=(0.0, 0.0), scale=90.0)
    fill(scenery(ground, view.scale), 1)
    poses = np.array(found.poses)
    body, dark = COLOURS[0]
    axes.plot(*poses[:, :2].T, color=[part / 255 for part in body], linewidth=2.2, zorder=2)
    for pose in poses[::-1][::OUTLINE_EVERY]:
        fill(car_shapes(view, pose[:3], float(pose[3]), colour=body, dark=dark), 3)
    if found.crashed:
        axes.plot(*poses[-1, :2], "o", markersize=34, mfc="none", mec=OUTSIDE, mew=2.5, zorder=4)
    axes.set(xlim=WINDOW[0], ylim=WINDOW[1], aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def draw_requirements(axes: Axes, found: Drive, task: Task) -> None:
    """In which part of the shown steps every requirement but the lap is met."""
    left, top, line, wide = WINDOW[0][0] + 0.35, WINDOW[1][1] - 0.45, 0.5, 1.6
    shown = [m for m, at in zip(found.margins, found.progress, strict=True) if at >= SHOWN[0]]
    for row, requirement in enumerate(r for r in task.requirements if r.kind != "achieve"):
        met = float(np.mean([margins[requirement.label] >= 0 for margins in shown]))
        words = f"{100 * met:.0f} %"
        if requirement.kind == "ensure":
            met, words = float(met == 1), "met" if met == 1 else "violated"
        y, start = top - row * line, left + 2.05
        axes.text(left, y, requirement.label, va="center", fontsize=9, color=INK)
        axes.plot([start, start + wide], [y, y], color=OUTSIDE, linewidth=5, solid_capstyle="butt")
        axes.plot(
            [start, start + met * wide], [y, y], color=IN_ZONE, linewidth=5, solid_capstyle="butt"
        )
        axes.text(start + wide + 0.12, y, words, va="center", fontsize=9, color=INK)


def draw_curve(axes: Axes, found: Drive, values: list[float], zone: tuple[float, float]) -> None:
    """A quantity over progress, and where it is within its comfort zone."""
    x, y = np.array(found.progress), np.array(values)
    shown = (x >= SHOWN[0]) & (x <= SHOWN[1] + 0.5)
    x, y = x[shown], y[shown]
    inside = (y >= zone[0]) & (y <= zone[1])
    axes.axhspan(*zone, color=ZONE, linewidth=0)
    axes.plot(x, y, color=FAINT, linewidth=1.2, zorder=2)
    for where, colour in ((inside, IN_ZONE), (~inside, OUTSIDE)):
        axes.plot(x[where], y[where], "o", color=colour, markersize=3.8, zorder=3)
    if found.crashed:
        axes.plot(x[-1], y[-1], "x", color=OUTSIDE, markersize=11, mew=2.5, zorder=4)
    axes.set(xlim=SHOWN)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(FAINT)
    axes.tick_params(colors=INK, labelsize=8.5, color=FAINT)


def main(picture: Picture) -> None:
    """Drive and draw."""
    task = task_of(BENCHMARK)
    draw(drive_all(task), task, picture.out)


def draw(drives: Mapping[str, Drive], task: Task, path: Path) -> None:
    """The drives side by side.

    Raises:
        MissingExtraError: Matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
        from PIL import Image
    except ModuleNotFoundError:
        raise MissingExtraError("matplotlib", "report") from None
    from hprs.envs.driving.rendering.ground import ground_of

    limits = task.ranges
    speeds = limits["speed_min"].low, limits["speed_max"].low
    change = limits["command_change"].low
    ground = ground_of(stack_tracks([one_turn()]), 0)
    figure = Figure(figsize=(11.4, 6.4), facecolor=PAPER, layout="constrained")
    rows = figure.subplots(
        3, len(drives), height_ratios=(3.0, 1, 1), squeeze=False, sharex="row", sharey="row"
    )
    for (turn, upper, lower), (name, found) in zip(rows.T, drives.items(), strict=True):
        turn.set_title(name, fontsize=12.5, color=INK, fontweight="bold", pad=9)
        draw_turn(turn, ground, found)
        draw_requirements(turn, found, task)
        draw_curve(upper, found, found.speed, speeds)
        draw_curve(lower, found, found.change, (-change, change))
        upper.set(ylim=(0.0, 5.0), yticks=[0, *speeds])
        lower.set(ylim=(-2.3, 2.3), yticks=[-2, -change, change, 2])
        lower.yaxis.set_major_formatter("{x:g}")
        lower.set_xlabel("progress (m)", fontsize=9, color=INK)
        for axes in (upper, lower):
            for place in TURN:
                axes.axvline(place, color=FAINT, linewidth=0.8, linestyle=(0, (2, 3)))
    rows[1][0].set_ylabel("speed (m/s)", fontsize=9, color=INK)
    rows[2][0].set_ylabel(f"steering change\nin {CONTROL_STEP:g} s", fontsize=9, color=INK)
    figure.align_ylabels(rows[1:, 0])
    data = io.BytesIO()
    figure.savefig(data, dpi=110, facecolor=PAPER)
    # A third of the size, and no eye can tell.
    Image.open(data).convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=1).save(
        path, optimize=True
    )


if __name__ == "__main__":
    try:
        main(tyro.cli(Picture, description=__doc__))
    except HprsError as error:
        sys.exit(str(error))
