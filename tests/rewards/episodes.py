"""Episodes for rewards, and what each reward pays for a whole episode, written down plainly.

The references look at the whole trace with plain loops, as the definitions read; none of them uses
the code that follows an episode step by step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np

from hprs import make_reward, parse_task
from hprs.rewards import Reward
from hprs.semantics.assessment import assess
from hprs.semantics.evaluation import evaluate
from hprs.spec.compiler import compile_margins
from hprs.spec.expression import And, Comparison, Predicate
from hprs.spec.task import Task
from hprs.spec.traversal import comparisons
from tests.semantics.random_tasks import random_signals, random_task

WINDOW = 4

LINE = parse_task("signal x in [0, 1]\nensure low: x <= 0.95\nachieve there: x >= 0.8")


def options_of(name: str, task: Task) -> dict[str, Any]:
    """Options that let a reward be made for any task."""
    weights = [0.1 * (index + 1) for index in range(len(task.requirements))]
    return {"morl": {"weights": weights}, "bhnr": {"window": WINDOW}}.get(name, {})


VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "hprs": ("hprs", {}),
    "hprs-no-comfort": ("hprs-no-comfort", {}),
    "sparse": ("sparse", {}),
    "env": ("env", {}),
    "morl": ("morl", {}),
    "morl-uniform": ("morl-uniform", {}),
    "morl-decreasing": ("morl-decreasing", {}),
    "tltl": ("tltl", {}),
    "tltl raw": ("tltl", {"margins": "raw"}),
    "bhnr": ("bhnr", {}),
    "bhnr boolean": ("bhnr", {"form": "boolean"}),
    "bhnr of one state": ("bhnr", {"window": 1}),
    "rank-preserving": ("rank-preserving", {}),
    "rank-preserving raw": ("rank-preserving", {"margins": "raw", "base": 3.0}),
    "pam": ("pam", {}),
    "vector": ("vector", {}),
    "vector of scores": ("vector", {"form": "score"}),
}
"""Every reward in every form, by a name for the test."""


def variant(name: str, task: Task, *, end: Any = "paper") -> Reward:
    """A reward of `VARIANTS`."""
    reward, options = VARIANTS[name]
    options = options_of(reward, task) | options
    return make_reward(reward, task, end=end, discount=0.9, **options)


def tasks(count: int) -> list[Task]:
    """Random tasks with finite bounds, targets of both kinds and of none, with preferences."""
    found, seed = [], 0
    while len(found) < count:
        seed += 1
        target = ("achieve", "conquer", None)[seed % 3]
        task = random_task(seed, target=target, depth=2, preferences=seed % 3)
        bounded = all(
            math.isfinite(leaf.low) and math.isfinite(leaf.high)
            for leaves in task.analysis.leaves.values()
            for leaf in leaves
        )
        if bounded and any(r.requirement_class != "comfort" for r in task.requirements):
            found.append(task)
    return found


def random_trace(seed: int, task: Task, shape: tuple[int, ...]) -> dict[str, Any]:
    """Signals of s_0 .. s_t, some of them outside their ranges, and the environment's reward."""
    rewards = np.random.default_rng(seed + 1).normal(size=shape)
    return random_signals(seed, task, shape, spread=1.2) | {"env_reward": rewards}


def rollout(
    reward: Reward, trace: dict[str, Any], *, terminated: bool, truncated: bool
) -> np.ndarray:
    """What is paid for an episode, one state after the other."""
    length = len(next(iter(trace.values())))
    at = [{name: values[t] for name, values in trace.items()} for t in range(length)]
    memory, paid = reward.init(at[0]), []
    for t in range(1, length):
        last = t == length - 1
        memory, value = reward.step(memory, at[t], last and terminated, last and truncated)
        paid.append(value)
    return np.asarray(paid)


def floats(trace: dict[str, Any]) -> dict[str, Any]:
    """A trace of one environment as Python numbers; vectors stay arrays."""
    return {
        name: value.tolist() if value.ndim == 1 else list(value) for name, value in trace.items()
    }


def expected(name: str, task: Task, trace: dict[str, Any]) -> np.ndarray:
    """What a variant pays for a whole episode of one environment, with the ending `paper`."""
    kind, options = VARIANTS[name]
    found = evaluate(task, trace)
    steps = len(trace["env_reward"]) - 1
    base = np.zeros(steps)
    if (row := next((i for i, r in enumerate(_rows(task)) if r.kind in _TARGET), None)) is not None:
        base = found.satisfied[row][1:] * 1.0
    scores = {r.label: found.scores[i] for i, r in enumerate(_rows(task))}
    if kind == "sparse":
        return base
    if kind == "env":
        return trace["env_reward"][1:]
    if kind == "hprs":
        return base + np.diff(psi(task, scores, task.labels))
    if kind == "hprs-no-comfort":
        hard = [r.label for r in task.requirements if r.kind != "encourage"]
        return base + np.diff(psi(task, scores, hard))
    if kind.startswith("morl"):
        weights = _weights(kind, task)
        return base + sum(w * np.diff(scores[r]) for w, r in zip(weights, task.labels, strict=True))
    if kind == "vector":
        columns = np.stack([scores[label] for label in task.labels], axis=-1)
        return columns[1:] if options else base[:, None] + np.diff(columns, axis=0)
    if kind == "bhnr":
        size = options.get("window", WINDOW)
        windows = [slice(max(0, t + 1 - size), t + 1) for t in range(1, steps + 1)]
        return np.array([filtered(task, trace, w, options.get("form")) for w in windows])
    last = {"tltl": _robustness, "rank-preserving": _rank, "pam": _pam}[kind](task, trace, options)
    return np.array([0.0] * (steps - 1) + [last])


_TARGET = ("achieve", "conquer")
_CLASS = {"ensure": 0, "achieve": 1, "conquer": 1, "encourage": 2}


def _rows(task: Task) -> list[Any]:
    return sorted(task.requirements, key=lambda r: _CLASS[r.kind])


def _weights(kind: str, task: Task) -> list[float]:
    if kind == "morl":
        return options_of("morl", task)["weights"]
    raw = [1.0] * len(task.labels)
    if kind == "morl-decreasing":
        raw = [(1.0, 0.5, 0.25)[_CLASS[r.kind]] for r in task.requirements]
    return [weight / sum(raw) for weight in raw]


def psi(task: Task, scores: dict[str, Any], labels: Sequence[str]) -> Any:
    """The hierarchical potential of some requirements."""
    total = np.zeros(len(next(iter(scores.values()))))
    for label in labels:
        product = scores[label]
        for higher in task.order.above[label]:
            product = product * scores[higher]
        total = total + product
    return total


def margins(task: Task, trace: dict[str, Any], form: str) -> dict[str, np.ndarray]:
    """Label to margins over time, each comparison normalised for itself unless `form` is raw."""
    found = {}
    for requirement in task.requirements:
        leaves = comparisons(requirement.predicate)
        values = iter(compile_margins(task, leaves, np)(trace))
        ranges = iter(task.analysis.leaves[requirement.label])
        found[requirement.label] = np.broadcast_to(
            _fold(requirement.predicate, values, ranges, form), len(trace["env_reward"])
        )
    return found


def _fold(predicate: Predicate, values: Any, ranges: Any, form: str) -> Any:
    if isinstance(predicate, Comparison):
        margin, bounds = np.asarray(next(values)), next(ranges)
        if form == "raw":
            return margin
        # A bound on the wrong side of 0 says nothing; the other one then stands for it.
        below, above = max(-bounds.low, 0.0), max(bounds.high, 0.0)
        scale = np.where(margin < 0.0, below or above, above or below)
        return np.clip(margin / (scale if below or above else 1.0), -1.0, 1.0)
    parts = [_fold(part, values, ranges, form) for part in predicate.parts]
    return reduce(np.minimum if isinstance(predicate, And) else np.maximum, parts)


def filtered(task: Task, trace: dict[str, Any], window: slice, form: str | None) -> float:
    """Filtering semantics at the first position of a window, by its definition."""
    if form == "boolean":
        satisfied = evaluate(task, trace).satisfied
        values = {r.label: satisfied[i] * 1.0 for i, r in enumerate(_rows(task))}
    else:
        values = margins(task, trace, "normalised")
    found = []
    for requirement in task.requirements:
        x = values[requirement.label][window]
        if requirement.kind == "ensure":
            found.append(x.min())
        if requirement.kind == "achieve":
            found.append(x.sum() / len(x))
        if requirement.kind == "conquer":
            found.append(sum(x[j:].min() for j in range(len(x))) / len(x))
    return min(found)


def episode_robustness(kind: str, x: np.ndarray) -> float:
    """Robustness of a requirement over the whole trace, from "always" and "eventually"."""
    if kind == "achieve":
        return x.max()
    if kind == "conquer":
        return max(x[j:].min() for j in range(len(x)))
    return x.min()


def _robustness(task: Task, trace: dict[str, Any], options: dict[str, Any]) -> float:
    x = margins(task, trace, options.get("margins", "normalised"))
    hard = [r for r in task.requirements if r.kind != "encourage"]
    return min(episode_robustness(r.kind, x[r.label]) for r in hard)


def _rank(task: Task, trace: dict[str, Any], options: dict[str, Any]) -> float:
    x = margins(task, trace, options.get("margins", "normalised"))
    whole = {r.label: episode_robustness(r.kind, x[r.label]) for r in task.requirements}

    def chain(label: str) -> int:
        return 1 + max((chain(higher) for higher in task.order.above[label]), default=0)

    count = max(chain(label) for label in task.labels)
    rho = [
        min(value for label, value in whole.items() if chain(label) == i + 1) for i in range(count)
    ]
    base = options.get("base", 2.01)
    powers = [base ** (count - i) * (value > 0) for i, value in enumerate(rho)]
    return sum(powers) + sum(math.tanh(value) for value in rho) / count


def _pam(task: Task, trace: dict[str, Any], options: dict[str, Any]) -> float:
    return assess(task, trace).pam
