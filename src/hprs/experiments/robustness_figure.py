"""Draws what a robustness test found: a panel a perturbation, and one of the tracks."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING

from hprs.experiments.perturbations import AS_TRAINED, TRACK
from hprs.experiments.robustness_result import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 4
_COLOURS = ("#0072b2", "#d55e00")
"""Of the first and the second policy (Okabe and Ito)."""
_LINES = {"S": (":", ""), "S+T": ("-", "o"), "S+T+C": ("--", "")}
"""Measure to line and marker: nothing is told by colour alone."""
_TRAINED = "#009e73"
_PANEL = (2.7, 1.9)
"""Width and height of a panel, inches."""
DOTS = 110
"""Per inch, of the PNG."""


def draw(rows: Sequence[Row]) -> dict[str, bytes]:
    """The picture, by the ending of its file: `png` and `svg`."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    policies = list(dict.fromkeys(row.policy for row in rows))
    names = [name for name in dict.fromkeys(row.perturbation for row in rows) if name != AS_TRAINED]
    numeric = [name for name in names if name != TRACK]
    has_tracks = TRACK in names
    lines = -(-len(numeric) // COLUMNS)
    heights = [_PANEL[1]] * lines + [2.6] * has_tracks
    if not heights:
        heights = [_PANEL[1]]
    figure = Figure(
        figsize=(COLUMNS * _PANEL[0], sum(heights) + 0.7),
        dpi=DOTS,
        layout=ConstrainedLayoutEngine(hspace=0.04),
    )
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(len(heights), COLUMNS, height_ratios=heights)
    for number, name in enumerate(numeric):
        axes = figure.add_subplot(grid[number // COLUMNS, number % COLUMNS])
        _sweep(axes, [row for row in rows if row.perturbation == name], policies)
    if has_tracks:
        axes = figure.add_subplot(grid[len(heights) - 1, :])
        _tracks(axes, [row for row in rows if row.perturbation == TRACK], policies)
    _legend(figure, policies)
    found: dict[str, bytes] = {}
    # The same rows give the same file: no date, and identifiers that are not drawn.
    with rc_context({"svg.hashsalt": "hprs"}):
        for ending, metadata in (("png", None), ("svg", {"Date": None})):
            data = io.BytesIO()
            figure.savefig(data, format=ending, metadata=metadata)
            found[ending] = data.getvalue()
    return found


def _sweep(axes: Axes, rows: Sequence[Row], policies: Sequence[str]) -> None:
    """One perturbation: value to S, S+T and S+T+C; where it was trained is shaded."""
    for policy, colour in zip(policies, _COLOURS, strict=False):
        own = [row for row in rows if row.policy == policy]
        values = [float(row.value) for row in own]
        trained = [value for value, row in zip(values, own, strict=True) if row.trained]
        if trained:
            # A single value is a line; the shade of the second policy lies over the first's.
            axes.axvspan(min(trained), max(trained), color=_TRAINED, alpha=0.1, linewidth=1.5)
        for name, (line, marker) in _LINES.items():
            found = [row.measures[name] for row in own]
            axes.plot(
                values, [one.value for one in found], linestyle=line, marker=marker,
                color=colour, markersize=3, linewidth=1.2,
            )  # fmt: skip
            if name == "S+T":
                axes.fill_between(
                    values, [one.low for one in found], [one.high for one in found],
                    color=colour, alpha=0.12, linewidth=0,
                )  # fmt: skip
    unit = f", {rows[0].unit}" if rows[0].unit not in ("", "1") else ""
    axes.set_title(f"{rows[0].perturbation}{unit}", fontsize=8.5, pad=3)
    axes.set_ylim(-0.03, 1.03)
    _plain(axes)


def _tracks(axes: Axes, rows: Sequence[Row], policies: Sequence[str]) -> None:
    """Tracks beside each other; those of a policy's training have a ring."""
    names = list(dict.fromkeys(row.value for row in rows))
    for number, (policy, colour) in enumerate(zip(policies, _COLOURS, strict=False)):
        shift = (number - (len(policies) - 1) / 2) * 0.3
        for row in (row for row in rows if row.policy == policy):
            at = names.index(row.value) + shift
            target, comfort = row.measures["S+T"], row.measures["S+T+C"]
            axes.plot([at, at], [target.low, target.high], color=colour, alpha=0.35, linewidth=2)
            axes.plot(at, target.value, "o", color=colour, markersize=4.5)
            axes.plot(at, comfort.value, "_", color=colour, markersize=7, markeredgewidth=1.5)
            if row.trained:
                axes.plot(
                    at, target.value, "o", markersize=10, markerfacecolor="none",
                    markeredgecolor=_TRAINED,
                )  # fmt: skip
    axes.set_xticks(range(len(names)), names, rotation=55, ha="right", rotation_mode="anchor")
    axes.set_xlim(-0.7, len(names) - 0.3)
    axes.set_ylim(-0.05, 1.08)
    axes.set_title(
        "tracks: S+T (dot, 95 % interval) and S+T+C (bar); a ring: trained on it", fontsize=8.5
    )
    axes.grid(axis="x", color="0.92")
    _plain(axes)


def _legend(figure, policies: Sequence[str]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color=colour, linewidth=2.5, label=policy)
        for policy, colour in zip(policies, _COLOURS, strict=False)
    ]
    handles += [
        Line2D([], [], color="0.3", linestyle=line, marker=marker, markersize=3, label=name)
        for name, (line, marker) in _LINES.items()
    ]
    handles.append(Patch(color=_TRAINED, alpha=0.25, label="values of the training"))
    figure.legend(
        handles=handles, loc="outside upper left", ncols=len(handles), frameon=False, fontsize=8.5
    )


def _plain(axes: Axes) -> None:
    axes.tick_params(labelsize=7.5, length=2.5, color="0.5")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color("0.6")
