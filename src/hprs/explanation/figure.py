"""Draws an explanation as one picture."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from hprs.explanation.explanation import Explanation, Part
from hprs.explanation.film import Film
from hprs.explanation.outline import Axis, Outline, axis, outline
from hprs.explanation.palette import colours, failing
from hprs.explanation.wording import bound, judgement, number, summary, verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 10.0
"""Of the picture, in inches."""
DOTS = 110
"""Per inch."""
STRIP = 6
"""Pictures of the episode above the plots."""
_HEIGHTS = {"strip": 1.25, "stack": 2.3, "part": 0.78}


def draw(explanation: Explanation, film: Film) -> bytes:
    """The explanation as a PNG file: potential, and every margin against its bounds."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    count = len(explanation.parts)
    heights = [_HEIGHTS["stack"], *[_HEIGHTS["part"]] * count]
    if film.frames:
        heights.insert(0, _HEIGHTS["strip"])
    layout = ConstrainedLayoutEngine(hspace=0.02, h_pad=0.03)
    # Without pyplot there is no global state, and no window.
    figure = Figure(figsize=(WIDTH, sum(heights) + 1.1), dpi=DOTS, layout=layout)
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    rows = list(range(len(heights)))
    if film.frames:
        _strip(figure, grid[rows.pop(0)], film, explanation)
    figure.suptitle(
        f"{explanation.title}\n{summary(explanation)}", x=0.01, ha="left", fontsize=10.5
    )
    drawn = outline(explanation)
    shades = colours(explanation.parts)
    top = figure.add_subplot(grid[rows[0]])
    _stack(top, explanation, drawn, shades)
    for row, part, shade in zip(rows[1:], explanation.parts, shades, strict=True):
        _margin(figure.add_subplot(grid[row], sharex=top), explanation, part, drawn, shade)
    _label_steps(figure.axes[-1], explanation)
    data = io.BytesIO()
    figure.savefig(data, format="png", pil_kwargs={"optimize": True})
    return data.getvalue()


def _strip(figure: Any, place: Any, film: Film, explanation: Explanation) -> None:
    from PIL import Image

    count = min(STRIP, len(film.frames))
    cells = place.subgridspec(1, count, wspace=0.03)
    chosen = np.linspace(0, len(film.frames) - 1, count).round().astype(int)
    for cell, index in zip(cells, chosen, strict=True):
        frame = film.frames[index]
        axes = figure.add_subplot(cell)
        axes.imshow(np.asarray(Image.open(io.BytesIO(frame.data)).convert("RGB")))
        axes.set(xticks=[], yticks=[])
        axes.set_title(explanation.moment(frame.step), fontsize=7.5, pad=3)
        for side in axes.spines.values():
            side.set(color="0.75")


def _stack(axes: Axes, explanation: Explanation, drawn: Outline, shades: list[str]) -> None:
    from matplotlib.ticker import MaxNLocator

    terms = [part.contributions[drawn.stops] for part in explanation.parts]
    labels = [part.name for part in explanation.parts]
    axes.stackplot(drawn.stops, *terms, colors=shades, alpha=0.85, linewidth=0, labels=labels)
    axes.plot(drawn.stops, explanation.potential[drawn.stops], color="black", linewidth=1.0)
    axes.set(ylim=(0, max(len(explanation.parts), 1)), xlim=(0, explanation.steps))
    axes.set_ylabel("potential", fontsize=8.5)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.tick_params(labelbottom=False)
    _plain(axes)
    handles, names = axes.get_legend_handles_labels()
    axes.legend(
        handles[::-1], names[::-1], loc="upper left", bbox_to_anchor=(1.005, 1.03),
        fontsize=7.5, frameon=False, handlelength=1.0, handleheight=0.9, labelspacing=0.35,
    )  # fmt: skip


def _margin(axes: Axes, explanation: Explanation, part: Part, drawn: Outline, shade: str) -> None:
    scale, bad = axis(part), failing(part)
    for low, high in drawn.violated(part):
        axes.axvspan(low - 0.5, high + 0.5, ymax=0.07, color=bad, linewidth=0)
    if drawn.is_exact:
        steps = drawn.stops
        least = greatest = scale.place(part.margins)
    else:
        steps = drawn.starts
        least, greatest = (
            scale.place(values(part.margins)) for values in (drawn.least, drawn.greatest)
        )
    axes.fill_between(
        steps, 0.5, greatest, where=greatest > 0.5, interpolate=True, color=shade, alpha=0.22, lw=0
    )
    axes.fill_between(
        steps, least, 0.5, where=least < 0.5, interpolate=True, color=bad, alpha=0.3, lw=0
    )
    axes.fill_between(steps, least, greatest, color=shade, lw=1.1)
    axes.axhline(0.5, color="0.35", linewidth=0.7)
    if part.first_violation is not None:
        axes.plot(
            part.first_violation, 1.0, marker="v", color=bad, markersize=6, clip_on=False, zorder=5
        )
    axes.set(ylim=(-0.02, 1.02), xlim=(0, explanation.steps))
    _ticks(axes, part, scale)
    axes.tick_params(labelbottom=False)
    _plain(axes)
    axes.text(
        1.012, 0.96, part.name, transform=axes.transAxes, fontsize=8.5, va="top", weight="bold"
    )
    axes.text(
        1.012, 0.73, _lines(explanation, part), transform=axes.transAxes, fontsize=7,
        va="top", color="0.25", linespacing=1.25,
    )  # fmt: skip


def _lines(explanation: Explanation, part: Part) -> str:
    predicate = part.predicate if len(part.predicate) <= 34 else f"{part.predicate[:33]}…"
    return "\n".join(
        (
            predicate,
            f"{verdict(explanation, part)}; worst margin {number(part.worst)}",
            judgement(part),
        )
    )


def _ticks(axes: Axes, part: Part, scale: Axis) -> None:
    ends = [part.low, 0.0, part.high]
    places = [float(scale.place(np.asarray([end]))[0]) for end in ends]
    kept = [(places[1], "0")]
    kept += [
        (place, bound(end))
        for place, end in ((places[0], part.low), (places[2], part.high))
        if abs(place - 0.5) > 0.15
    ]
    axes.set_yticks([place for place, _ in kept], [text for _, text in kept], fontsize=7)


def _label_steps(axes: Axes, explanation: Explanation) -> None:
    axes.tick_params(labelbottom=True)
    rate = explanation.rate
    axes.set_xlabel("step" if rate is None else f"step ({rate:g} a second)", fontsize=8.5)


def _plain(axes: Axes) -> None:
    axes.tick_params(labelsize=7.5, length=2.5, color="0.5")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("0.6")
