"""Runs that differ in their seed alone, and benchmarks on which several of them are compared."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from hprs.experiments.recorded import Recorded
from hprs.experiments.statistics import Numbers, steps_to
from hprs.rewards.registry import REWARDS
from hprs.training.configuration import Configuration

_POINTS = 120
"""Of a curve, at most."""


@dataclass(frozen=True, eq=False)
class Group:
    """The seeds of one configuration."""

    label: str
    """What tells it from the others of its benchmark."""
    runs: tuple[Recorded, ...]
    """In the order of their seeds."""

    @property
    def configuration(self) -> Configuration:
        """That of the first seed."""
        return self.runs[0].configuration

    def newest(self, measure: str) -> Numbers:
        """(seeds,) the means of the last policies."""
        return np.array([run.newest[measure] for run in self.runs])

    @cached_property
    def steps(self) -> Numbers:
        """(k,) at which its curves are shown, up to where the shortest run is."""
        end = min(run.steps[-1] for run in self.runs)
        longest = max(self.runs, key=lambda run: len(run.steps)).steps
        steps = longest[longest <= end]
        chosen = np.linspace(0, len(steps) - 1, min(len(steps), _POINTS)).round().astype(int)
        return steps[np.unique(chosen)]

    @cached_property
    def seconds(self) -> Numbers:
        """(k,) mean seconds of training up to `steps`; NaN where a run does not know them."""
        return self._aligned(lambda run: run.seconds).mean(axis=1)

    def curve(self, measure: str) -> Numbers:
        """(k, seeds) a measure at `steps`; between two evaluations of a seed on a straight line."""
        return self._aligned(lambda run: run.means[measure])

    def reached(self) -> list[tuple[float, float]]:
        """Of each seed steps and seconds to S+T >= 0.9; infinite where it never got there."""
        found: list[tuple[float, float]] = []
        for run in self.runs:
            step = steps_to([int(step) for step in run.steps], run.means["S+T"].tolist())
            at = np.inf if step is None else float(np.interp(step, run.steps, run.seconds))
            found.append((np.inf if step is None else float(step), at))
        return found

    def _aligned(self, values: Any) -> Numbers:
        return np.stack([np.interp(self.steps, run.steps, values(run)) for run in self.runs], -1)


@dataclass(frozen=True, eq=False)
class Benchmark:
    """An environment with its task, and what was trained for it."""

    name: str
    groups: tuple[Group, ...]

    @property
    def configuration(self) -> Configuration:
        """One of those with its environment and its task."""
        return self.groups[0].configuration

    @property
    def requirements(self) -> list[str]:
        """`kind.label` of each requirement."""
        return [f"{found.kind}.{found.label}" for found in self.configuration.task.requirements]


def benchmarks(recorded: Iterable[Recorded]) -> list[Benchmark]:
    """Runs by what they were trained for, and with."""
    places: dict[str, dict[str, list[Recorded]]] = {}
    for one in recorded:
        groups = places.setdefault(_place(one.configuration), {})
        groups.setdefault(_same_but_seed(one.configuration), []).append(one)
    found: list[Benchmark] = []
    for name, groups in zip(_names(list(places)), places.values(), strict=True):
        seeds = [
            tuple(sorted(runs, key=lambda run: run.configuration.seed)) for runs in groups.values()
        ]
        labels = labelled([runs[0].configuration for runs in seeds])
        pairs = sorted(zip(labels, seeds, strict=True), key=lambda pair: _order(*pair))
        found.append(Benchmark(name, tuple(Group(label, runs) for label, runs in pairs)))
    return sorted(found, key=lambda benchmark: benchmark.name)


def labelled(configurations: Sequence[Configuration]) -> list[str]:
    """The reward of each, with its end, and whatever else tells it from those with the same one."""
    words = [_words(configuration) for configuration in configurations]
    varying = {name for name in words[0] if len({found[name] for found in words}) > 1}
    labels = [
        " ".join([reward_with_end(c), *(found[name] for name in found if name in varying)]).strip()
        for c, found in zip(configurations, words, strict=True)
    ]
    settings = [_differing(c, label, configurations, labels) for c, label in
                zip(configurations, labels, strict=True)]  # fmt: skip
    found = [" ".join([label, *more]) for label, more in zip(labels, settings, strict=True)]
    return [
        label if found.count(label) == 1 else f"{label} {configuration.digest}"
        for label, configuration in zip(found, configurations, strict=True)
    ]


def is_shaped(configuration: Configuration) -> bool:
    """Whether the end of an episode makes a difference to the reward."""
    return configuration.reward in REWARDS and REWARDS[configuration.reward].shaped


def reward_with_end(configuration: Configuration) -> str:
    """The reward, with the end of an episode where that makes a difference."""
    reward = configuration.reward
    return f"{reward} {configuration.end}" if is_shaped(configuration) else reward


def _words(configuration: Configuration) -> dict[str, str]:
    return {
        "algorithm": configuration.algorithm,
        "trainer": configuration.trainer,
        "steps": f"{configuration.steps:,} steps",
    }


def _differing(
    configuration: Configuration,
    label: str,
    configurations: Sequence[Configuration],
    labels: Sequence[str],
) -> list[str]:
    """Settings that tell a configuration from those with the same label."""
    same = [c for c, other in zip(configurations, labels, strict=True) if other == label]
    own: Mapping[str, Any] = {**configuration.parameters, **configuration.reward_options}
    return [
        f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
        for name, value in own.items()
        if len({json.dumps({**c.parameters, **c.reward_options}.get(name)) for c in same}) > 1
    ]


def _place(configuration: Configuration) -> str:
    return json.dumps(
        [configuration.environment, configuration.environment_options, configuration.horizon,
         configuration.task_text]
    )  # fmt: skip


def _same_but_seed(configuration: Configuration) -> str:
    # Not the digest: it parses the task, which takes longer than to read the run.
    return json.dumps({**configuration.to_json(), "seed": None}, sort_keys=True)


def _names(places: Sequence[str]) -> list[str]:
    """Of each place its environment, with its options, and a number where the rest differs."""
    names: list[str] = []
    for place in places:
        environment, options, horizon, _ = json.loads(place)
        words = [environment, *(f"{key}={value}" for key, value in options.items())]
        names.append(" ".join(words if horizon is None else [*words, f"horizon={horizon}"]))
    return [
        name if names.count(name) == 1 else f"{name}, task {names[: index + 1].count(name)}"
        for index, name in enumerate(names)
    ]


def _order(label: str, runs: Sequence[Recorded]) -> tuple[int, str]:
    """Rewards as the registry has them."""
    known = list(REWARDS)
    reward = runs[0].configuration.reward
    return known.index(reward) if reward in known else len(known), label
