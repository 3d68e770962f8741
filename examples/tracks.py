"""Draws tracks side by side at one scale: corridor, walls, centre line, start and length.

Examples:
  python examples/tracks.py --out docs/pictures/tracks.png
  python examples/tracks.py random:1 random:2 --out picture.png
  python examples/tracks.py map.yaml --centre-line centerline.csv --out picture.png
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import tyro

from hprs.carsim.designs import load_track
from hprs.carsim.geometry import normals
from hprs.carsim.random_track import random_track
from hprs.errors import HprsError, MissingExtraError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hprs.carsim.track import Track

GROUND, ASPHALT, WALL, LINE, START = "#f5f3ee", "#cfd3d8", "#23272e", "#ffffff", "#c0392b"
GAP = 1.6
"""Between tracks, in m."""
INCHES_A_METRE = 0.32


@dataclass(frozen=True)
class Tracks:
    """Draw tracks side by side at one scale."""

    names: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="TRACK")] = (
        "gm-c",
        "gm",
        "trt",
    )
    """A built-in track, random:SEED, or a map's YAML file."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("tracks.png")
    """Where the picture goes."""
    centre_line: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The centre line of the maps, as CSV."""
    reverse: bool = False
    """Drive the other way round."""


def find_track(name: str, options: Tracks) -> Track:
    """The track that is meant by a name."""
    if name.startswith("random:") and name.removeprefix("random:").isdigit():
        return random_track(int(name.removeprefix("random:")), reverse=options.reverse)
    if name.endswith((".yaml", ".yml")):
        from hprs.carsim.map_file import load_map

        return load_map(name, centre_line=options.centre_line, reverse=options.reverse)
    return load_track(name, reverse=options.reverse)


def draw(axes: Axes, track: Track, *, title: str, corner: tuple[float, float]) -> None:
    """A track whose lower left corner lies at the given place of the picture."""
    walls = np.asarray(track.walls, float)
    shift = np.array(corner) - walls.reshape(-1, 2).min(axis=0)
    centre = np.asarray(track.centre, float) + shift
    across = normals(centre)
    left = centre + np.asarray(track.left)[:, None] * across
    right = centre - np.asarray(track.right)[:, None] * across
    ring = np.concatenate([left, left[:1], right[:1], right[::-1]])
    axes.fill(*ring.T, color=ASPHALT, linewidth=0)
    for x0, y0, x1, y1 in walls:
        axes.plot(
            [x0 + shift[0], x1 + shift[0]],
            [y0 + shift[1], y1 + shift[1]],
            color=WALL,
            linewidth=2.4,
            solid_capstyle="round",
        )
    axes.plot(*centre.T, color=LINE, linewidth=1.3, dashes=(5, 4))
    axes.plot(*np.stack([left[0], right[0]]).T, color=START, linewidth=3, solid_capstyle="butt")
    ahead = np.searchsorted(np.arange(len(centre)) * float(track.length) / len(centre), [0.3, 1.5])
    axes.annotate(
        "",
        xy=tuple(centre[ahead[1]]),
        xytext=tuple(centre[ahead[0]]),
        arrowprops={"arrowstyle": "-|>", "color": START, "linewidth": 1.8, "shrinkA": 0},
    )
    low, high = walls[:, [0, 2]].min(), walls[:, [0, 2]].max()
    middle = (low + high) / 2 + shift[0]
    axes.text(
        middle, corner[1] - 0.5, title, ha="center", va="top", fontsize=12, color=WALL,
        fontweight="bold",
    )  # fmt: skip
    width = np.asarray(track.left + track.right)
    axes.text(
        middle,
        corner[1] - 1.25,
        f"{float(track.length):.2f} m long, {width.min():.1f} m to {width.max():.1f} m wide",
        ha="center",
        va="top",
        fontsize=9,
        color=WALL,
    )


def run(options: Tracks) -> None:
    """Draw the tracks.

    Raises:
        MissingExtraError: Matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError("matplotlib", "report") from None
    found = [find_track(name, options) for name in options.names]
    sizes = [np.ptp(np.asarray(t.walls).reshape(-1, 2), axis=0) for t in found]
    # A short track is narrower than what is written below it.
    columns = [max(float(width), 6.8) for width, _ in sizes]
    height = max(float(size[1]) for size in sizes)
    total = sum(columns) + GAP * (len(columns) + 1)
    low, high = -2.4, height + 0.9
    figure = Figure(
        figsize=(total * INCHES_A_METRE, (high - low) * INCHES_A_METRE), facecolor=GROUND
    )
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, total), ylim=(low, high), aspect="equal")
    axes.axis("off")
    x = GAP
    for name, track, size, column in zip(options.names, found, sizes, columns, strict=True):
        corner = (x + (column - float(size[0])) / 2, (height - float(size[1])) / 2)
        title = Path(name).stem if name.endswith((".yaml", ".yml")) else name
        draw(axes, track, title=title, corner=corner)
        x += column + GAP
    axes.plot([total - 6, total - 1], [low + 0.45] * 2, color=WALL, linewidth=2)
    axes.text(total - 3.5, low + 0.6, "5 m", ha="center", va="bottom", fontsize=9, color=WALL)
    figure.savefig(options.out, dpi=110, facecolor=GROUND)


if __name__ == "__main__":
    try:
        run(tyro.cli(Tracks, description=__doc__))
    except HprsError as error:
        sys.exit(str(error))
