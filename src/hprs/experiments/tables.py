"""The tables of a report, as data: one for each question about a benchmark."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from hprs.experiments import published
from hprs.experiments.groups import Benchmark, Group, is_shaped
from hprs.experiments.offline import Means
from hprs.experiments.recorded import PADDED
from hprs.experiments.statistics import (
    ENOUGH,
    FAILED,
    Numbers,
    failed_seeds,
    improvement_interval,
    interquartile_mean,
    interval,
    probability_of_improvement,
)
from hprs.training.intervals import wilson

CLOSE = 0.05
"""What is as far as this below the best S+T+C is set in bold, as in the paper's table."""

Found: TypeAlias = Mapping[Group, Sequence[Means]]
"""Of each group the means of its seeds' last policies."""


@dataclass(frozen=True)
class Cell:
    """A cell of a table."""

    text: str
    value: float | None = None
    """What it is sorted by, and written into a CSV file; None for words."""
    bold: bool = False


@dataclass(frozen=True)
class Table:
    """A table."""

    name: str
    """Of its files."""
    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()


def offline_table(
    benchmark: Benchmark, found: Found, floors: Mapping[str, Means], episodes: int
) -> Table:
    """S, S+T and S+T+C of the last policies, the best in bold, and the floors."""
    comfort = {group: float(np.mean(_column(found[group], "S+T+C"))) for group in benchmark.groups}
    best = max(comfort.values())
    rows: list[tuple[Cell, ...]] = []
    for group in benchmark.groups:
        column = {name: _column(found[group], name) for name in ("S", "S+T", "S+T+C")}
        target = column["S+T"]
        low, high = _interval(target, episodes)
        rows.append(
            (
                _words(group.label),
                _count(len(target)),
                _number(column["S"].mean()),
                _number(target.mean()),
                _count(failed_seeds(target)),
                _number(interquartile_mean(target)),
                Cell(f"{low:.2f} to {high:.2f}", low),
                _number(comfort[group], bold=best > 0 and comfort[group] >= best - CLOSE),
            )
        )
    for name, means in floors.items():
        empty = _words("")
        rows.append(
            (_words(name), empty, _number(means["S"]), _number(means["S+T"]), empty, empty, empty,
             _number(means["S+T+C"]))
        )  # fmt: skip
    alone = any(len(group.runs) == 1 for group in benchmark.groups)
    return Table(
        "offline",
        "Safe, on target, comfortable",
        ("reward", "seeds", "S", "S+T", f"seeds below {FAILED:g}", "IQM", "95 % of S+T", "S+T+C"),
        tuple(rows),
        (
            f"Last policies, {episodes} episodes each. S: safe; S+T: safe and on target; S+T+C: "
            "the mean comfort of those, failures counting 0. Means are over seeds, IQM is the "
            "interquartile mean of S+T; intervals draw seeds again, never episodes."
            + (" Of one seed alone they are Wilson's, over its episodes." if alone else ""),
            f"Bold: at most {CLOSE:g} below the best S+T+C.",
        ),
    )


def requirement_table(benchmark: Benchmark, found: Found, floors: Mapping[str, Means]) -> Table:
    """How often each requirement was met: of episodes, or of steps where it is a wish."""
    names = benchmark.requirements
    rows = [
        (_words(group.label), *(_number(_column(found[group], name).mean()) for name in names))
        for group in benchmark.groups
    ]
    rows += [
        (_words(floor), *(_number(means[name]) for name in names))
        for floor, means in floors.items()
    ]
    return Table(
        "requirements",
        "Each requirement",
        ("reward", *(name.replace(".", " ", 1) for name in names)),
        tuple(rows),
        ("Fraction of the episodes that meet it; of what is encouraged, of their steps.",),
    )


def ablation_table(
    benchmark: Benchmark, found: Found, floors: Mapping[str, Means], *, paper: bool
) -> Table | None:
    """What the comfort requirements get with and without them in the reward; None if not trained.

    Args:
        benchmark: The benchmark.
        found: Of each group the means of its seeds' last policies.
        floors: Of the policies that know nothing.
        paper: Whether the published numbers are set beside.
    """
    pair = [_same_end(benchmark, reward) for reward in ("hprs", "hprs-no-comfort")]
    wishes = [name for name in benchmark.requirements if name.startswith("encourage.")]
    if None in pair or not wishes:
        return None
    known = published.ablation(benchmark.configuration.environment) if paper else {}
    rows: list[tuple[Cell, ...]] = []
    for name in wishes:
        cells = [_spread(_column(found[group], name)) for group in pair if group is not None]
        cells += [_number(means[name]) for means in floors.values()]
        label = name.partition(".")[2]
        if known:
            row = known.get(label)
            cells += [
                _words("") if row is None else _mean(row.mean, row.deviation),
                _words("") if row is None else _mean(row.mean_without, row.deviation_without),
            ]
        rows.append((_words(label), *cells))
    header = ["requirement", *(group.label for group in pair if group is not None), *floors]
    header += ["paper, with comfort", "paper, without"] if known else []
    note = "Fraction of the steps, mean and standard deviation over seeds"
    return Table(
        "ablation",
        "What comfort in the reward buys",
        tuple(header),
        tuple(rows),
        (f"{note}; the paper's deviations are over episodes." if known else f"{note}.",),
    )


def improvement_table(
    benchmark: Benchmark, found: Found, floors: Mapping[str, Means]
) -> Table | None:
    """How likely a seed of a row's reward has a higher S+T+C than one of a column's."""
    groups = benchmark.groups
    if len(groups) < 2:
        return None
    values = {group: _column(found[group], "S+T+C") for group in groups}
    ground = {name: np.array([means["S+T+C"]]) for name, means in floors.items()}
    rows = [
        (
            _words(group.label),
            *(
                _words("") if other is group else _chance(values[group], values[other])
                for other in groups
            ),
            *(_number(probability_of_improvement(values[group], one)) for one in ground.values()),
        )
        for group in groups
    ]
    return Table(
        "improvement",
        "Which reward beats which",
        ("reward", *(group.label for group in groups), *ground),
        tuple(rows),
        (
            "Probability that a seed of the row has a higher S+T+C than one of the column; ties "
            "count half. In parentheses 95 % intervals that draw the seeds of both again.",
        ),
    )


def cost_table(benchmark: Benchmark) -> Table:
    """Steps and seconds to an S+T of 0.9, and of the whole training."""
    rows = [_cost(group) for group in benchmark.groups]
    return Table(
        "cost",
        "What it costs",
        (
            "reward", f"steps to {ENOUGH:g}", f"seconds to {ENOUGH:g}", "never", "steps", "seconds",
            "steps a second",
        ),
        tuple(rows),
        (
            f"To the first of three evaluations in a row with an S+T of {ENOUGH:g}, median over "
            "the seeds, of which those that never get there count as infinite. Seconds are of a "
            "training as it ran, beside others where there were any. Doing nothing and random "
            "actions cost nothing, and never get there.",
        ),
    )  # fmt: skip


def comparison_table(
    benchmark: Benchmark, found: Found, floors: Mapping[str, Means]
) -> Table | None:
    """The published numbers beside one's own; None where the paper has none."""
    environment = benchmark.configuration.environment
    known = published.offline(environment)
    if not known:
        return None
    rows: list[tuple[Cell, ...]] = []
    for group in benchmark.groups:
        row = known.get(group.configuration.reward)
        theirs = [_words("")] * 3 if row is None else [_number(value) for value in row]
        ours = [_number(_column(found[group], name).mean()) for name in _COMPARED]
        rows.append((_words(group.label), *ours, *theirs, _words(_difference(group, row))))
    for name, means in floors.items():
        ours = [_number(means[measure]) for measure in _COMPARED]
        rows.append((_words(name), *ours, *[_words("")] * 4))
    return Table(
        "paper",
        "Beside the paper",
        ("reward", "S", "S+T", "S+T+C", "S+T+C, padded", "paper S", "paper S+T",
         "paper S+T+C, padded", "not like for like"),
        tuple(rows),
        (
            f"The paper's rows: {published.unlike(environment)}. Padded: comfort counts as "
            "violated from the end of an episode up to the horizon, as in the paper's table. "
            "Compare the order of rewards rather than the numbers.",
        ),
    )  # fmt: skip


def _difference(group: Group, row: published.Offline | None) -> str:
    if row is None:
        return "not in the paper"
    configuration, found = group.configuration, []
    if configuration.algorithm != "sac":
        found.append(f"{configuration.algorithm.upper()}, not SAC")
    if is_shaped(configuration) and configuration.end != "released":
        found.append(f"end {configuration.end}, not the released code's")
    if len(group.runs) != _PUBLISHED_SEEDS:
        found.append(f"{len(group.runs)} seeds, not {_PUBLISHED_SEEDS}")
    return ", ".join(found)


_PUBLISHED_SEEDS = 10
_COMPARED = ("S", "S+T", "S+T+C", PADDED)


def _same_end(benchmark: Benchmark, reward: str) -> Group | None:
    """The group of a reward, of those with the end that both HPRS and its ablation have."""
    by_reward = {
        name: {g.configuration.end: g for g in reversed(benchmark.groups)
               if g.configuration.reward == name}
        for name in ("hprs", "hprs-no-comfort")
    }  # fmt: skip
    both = [end for end in by_reward["hprs"] if end in by_reward["hprs-no-comfort"]]
    return by_reward[reward][both[0]] if both else None


def _cost(group: Group) -> tuple[Cell, ...]:
    reached = group.reached()
    steps = float(np.median([step for step, _ in reached]))
    # Who never gets there takes for ever, even where no times are recorded.
    seconds = math.inf if math.isinf(steps) else float(np.median([second for _, second in reached]))
    total = float(np.mean([run.steps[-1] for run in group.runs]))
    took = float(np.mean([run.seconds[-1] for run in group.runs]))
    return (
        _words(group.label),
        _amount(steps),
        _amount(seconds),
        _count(sum(math.isinf(step) for step, _ in reached)),
        _amount(total),
        _amount(took),
        _amount(total / took if took else math.nan),
    )


def _interval(values: Numbers, episodes: int) -> tuple[float, float]:
    if len(values) == 1:
        return wilson(round(float(values[0]) * episodes), episodes)
    low, high = interval(values)
    return float(low), float(high)


def _chance(one: Numbers, other: Numbers) -> Cell:
    value = probability_of_improvement(one, other)
    if min(len(one), len(other)) < 2:
        return _number(value)
    low, high = improvement_interval(one, other)
    return Cell(f"{value:.2f} ({low:.2f} to {high:.2f})", value)


def _column(means: Sequence[Means], name: str) -> Numbers:
    return np.array([one[name] for one in means])


def _words(text: str) -> Cell:
    return Cell(text)


def _number(value: float, *, bold: bool = False) -> Cell:
    return Cell(f"{value:.2f}", float(value), bold)


def _count(value: int) -> Cell:
    return Cell(str(value), float(value))


def _amount(value: float) -> Cell:
    if math.isnan(value):
        return Cell("not known", value)
    return Cell("never" if math.isinf(value) else f"{value:,.0f}", value)


def _mean(value: float, deviation: float) -> Cell:
    return Cell(f"{value:.2f} ± {deviation:.2f}", value)


def _spread(values: Numbers) -> Cell:
    return _mean(float(values.mean()), float(values.std(ddof=1)) if len(values) > 1 else 0.0)
