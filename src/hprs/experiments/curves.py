"""Learning curves of a benchmark: as data of a page, and as pictures."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np

from hprs.experiments.groups import Benchmark, Group
from hprs.experiments.statistics import (
    FAILED,
    Numbers,
    failed_seeds,
    interquartile_band,
    interquartile_mean,
)
from hprs.semantics.assessment import ACCOMPLISHED

COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e6a100", "#56b4e9", "#5e5e5e", "#8c564b",
    "#6a3d9a", "#b2a100",
)  # fmt: skip
"""Told apart by people with any kind of colour vision (Okabe and Ito, and two more)."""
DASHES = ("", "6 3", "2 2", "8 3 2 3")
"""Of the lines, which tell them apart without colour; in units of their width."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*", "<", ">")
_DIGITS = 4
_SIZE = (10.5, 3.3)
"""Of a picture, in inches."""
_DOTS = 160
_LETTERS, _HANDLE = 165, 10
"""Letters of a legend beside each other in a picture, and those that a line takes."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A line with a band."""

    middle: Numbers
    low: Numbers
    high: Numbers


@dataclass(frozen=True)
class View:
    """What is drawn of the seeds."""

    title: str
    measure: str
    curve: Callable[[Numbers], Curve]
    """Of values (k, seeds)."""
    top: float = 1.0
    """Of the axis."""
    mark: float | None = None
    """Where a line is drawn across."""

    def to_page(self) -> dict[str, Any]:
        """What a page must know of it."""
        return {"title": self.title, "top": self.top, "mark": self.mark}


def _deviation(values: Numbers) -> Curve:
    middle, spread = values.mean(axis=1), values.std(axis=1)
    return Curve(middle, np.maximum(middle - spread, 0.0), middle + spread)


def _range(values: Numbers) -> Curve:
    return Curve(values.mean(axis=1), values.min(axis=1), values.max(axis=1))


def _interquartile(values: Numbers) -> Curve:
    return Curve(interquartile_mean(values), *interquartile_band(values))


VIEWS: Mapping[str, View] = MappingProxyType(
    {
        "pam": View(
            "PAM, mean and standard deviation of seeds", "PAM", _deviation, 1.8, ACCOMPLISHED
        ),
        "mean": View("S+T, mean and range of seeds", "S+T", _range),
        "iqm": View("S+T, interquartile mean and 95 % interval", "S+T", _interquartile),
    }
)
"""The paper's figure, the mean, and the interquartile mean with a bootstrap over seeds."""


def to_page(benchmark: Benchmark) -> list[dict[str, Any]]:
    """The curves of each group as data."""
    return [
        {
            "label": group.label,
            "colour": COLOURS[index % len(COLOURS)],
            "dash": DASHES[index // len(COLOURS) % len(DASHES)],
            "seeds": len(group.runs),
            "failed": failed_seeds(group.newest("S+T")),
            "steps": _numbers(group.steps),
            "seconds": None if np.isnan(group.seconds).any() else _numbers(group.seconds),
            "views": {
                name: [_numbers(line) for line in (curve.middle, curve.low, curve.high)]
                for name, curve in _curves(group).items()
            },
        }
        for index, group in enumerate(benchmark.groups)
    ]


def draw(benchmark: Benchmark, over: str) -> dict[str, bytes]:
    """The curves as pictures: suffix to the file's content.

    Args:
        benchmark: The benchmark.
        over: `steps` or `seconds`.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # Without pyplot there is no global state. Equal curves give equal files: no time, no chance.
    with rc_context({"svg.hashsalt": "hprs", "svg.fonttype": "path"}):
        figure = Figure(figsize=_SIZE, dpi=_DOTS, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(VIEWS))
        for axes, (name, view) in zip(panels, VIEWS.items(), strict=True):
            _panel(axes, benchmark, name, view, over)
        lines, labels = panels[0].get_legend_handles_labels()
        figure.legend(
            lines, labels, loc="outside lower center", ncols=_columns(labels), fontsize=7.5,
            frameon=False, handlelength=3.2,
        )  # fmt: skip
        figure.suptitle(benchmark.name, x=0.01, ha="left", fontsize=10, weight="bold")
        found: dict[str, bytes] = {}
        for suffix, options in ((".png", {"Software": None}), (".svg", {"Date": None})):
            data = io.BytesIO()
            figure.savefig(data, format=suffix[1:], metadata=options)
            found[suffix] = data.getvalue()
    return found


def _panel(axes: Any, benchmark: Benchmark, name: str, view: View, over: str) -> None:
    for index, group in enumerate(benchmark.groups):
        places = group.steps if over == "steps" else group.seconds
        curve = _curves(group)[name]
        colour, dash = COLOURS[index % len(COLOURS)], index // len(COLOURS) % len(DASHES)
        axes.fill_between(places, curve.low, curve.high, color=colour, alpha=0.13, linewidth=0)
        axes.plot(
            places, curve.middle, color=colour, linewidth=1.4,
            linestyle=(0, tuple(map(float, DASHES[dash].split()))) if dash else "-",
            marker=MARKERS[index % len(MARKERS)], markersize=3.2,
            # Marks tell lines apart in print; of each line they stand elsewhere.
            markevery=(0.05 + 0.02 * (index % 5), 0.19),
            label=_legend(group),
        )  # fmt: skip
    if view.mark is not None:
        axes.axhline(view.mark, color="0.4", linewidth=0.8, linestyle=(0, (4, 3)))
    axes.set_ylim(-0.03 * view.top, 1.03 * view.top)
    axes.set_title(view.title, fontsize=8)
    axes.set_xlabel("environment steps" if over == "steps" else "seconds of training", fontsize=8)
    axes.ticklabel_format(axis="x", style="sci", scilimits=(0, 5))
    axes.xaxis.get_offset_text().set_fontsize(7)
    axes.tick_params(labelsize=7.5)
    axes.set_xlim(left=0)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _columns(labels: Sequence[str]) -> int:
    """Of the legend, so that it is no wider than the picture."""
    return max(1, min(len(labels), _LETTERS // (max(map(len, labels)) + _HANDLE)))


def _legend(group: Group) -> str:
    failed = failed_seeds(group.newest("S+T"))
    return f"{group.label} ({failed} of {len(group.runs)} seeds end below {FAILED:g})"


# A group's are drawn three times, and a bootstrap takes long.
@cache
def _curves(group: Group) -> Mapping[str, Curve]:
    return {name: view.curve(group.curve(view.measure)) for name, view in VIEWS.items()}


def _numbers(values: Numbers) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]
