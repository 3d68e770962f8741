"""Margins, scores and the potential, against values worked by hand and the paper's formula."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs import assess, parse_task
from hprs.errors import SignalError
from hprs.semantics.evaluation import (
    carry,
    evaluate,
    evaluate_arrays,
    margins,
    potential,
    scores,
)
from hprs.semantics.plan import plan_of
from hprs.spec.task import Task
from tests.semantics.random_tasks import random_signals, random_task

HALFWAY = {
    "lap": 0.5,
    "walls": 0.3,
    "centre": 0.25,
    "v": 1.0,
    "alpha": -0.55,
    "turned": np.asarray([0.0, 0.0]),
}
CRASHED = HALFWAY | {"walls": 0.0}
FINISHED = {
    "lap": 1.0,
    "walls": 0.3,
    "centre": 0.5,
    "v": 2.0,
    "alpha": 0.1,
    "turned": np.asarray([0.15, -0.2]),
}


def as_batch(*states: dict[str, Any]) -> dict[str, Any]:
    return {name: np.asarray([state[name] for state in states]) for name in states[0]}


def test_driving_halfway_is_worth_three_and_a_half(driving: Task) -> None:
    expected = {
        "finish": 0.5 - 1.0,  # l = 0 - 1 = -1: score 1 - 0.5/1 = 0.5
        "off_walls": 0.3,  # safety: score 1
        "central": 0.5 - 0.25,  # met: score 1
        "fast": 1.0 - 2.0,  # l = 0 - 2 = -2: score 1 - 1/2 = 0.5
        "slow": 3.5 - 1.0,  # met: score 1
        "straight": 0.1 - 0.55,  # l = 0.1 - 1 = -0.9: score 1 - 0.45/0.9 = 0.5
        "smooth": 0.25 - 0.0,  # met: score 1
    }
    found = margins(driving, HALFWAY)
    assert list(found) == list(expected)
    assert found == pytest.approx(expected)
    assert scores(driving, HALFWAY) == pytest.approx(
        dict(finish=0.5, off_walls=1, central=1, fast=0.5, slow=1, straight=0.5, smooth=1)
    )
    # S + S t + S t (sum of comfort) = 1 + 0.5 + 0.5 * (1 + 0.5 + 1 + 0.5 + 1)
    assert driving.potential(HALFWAY) == pytest.approx(3.5)


def test_touching_the_wall_loses_everything(driving: Task) -> None:
    # `walls > 0` is strict, so a margin of 0 violates it: S = 0.
    assert margins(driving, CRASHED)["off_walls"] == 0.0
    assert scores(driving, CRASHED)["off_walls"] == 0.0
    assert potential(driving, CRASHED) == 0.0


def test_finishing_in_comfort_is_worth_all_seven(driving: Task) -> None:
    # Every margin is 0 or more: norm(0.15, -0.2) = 0.25 exactly, and no comparison is strict here.
    assert potential(driving, FINISHED) == pytest.approx(7.0)
    assert driving.bounds["smooth"] == pytest.approx((0.25 - math.sqrt(8.0), 0.25))


def test_a_batch_gives_the_same_as_its_states(driving: Task) -> None:
    found = evaluate(driving, as_batch(HALFWAY, CRASHED, FINISHED))
    np.testing.assert_allclose(found.potential, [3.5, 0.0, 7.0])
    assert found.margins.shape == (7, 3)
    assert found.satisfied[0].tolist() == [True, False, True]


@pytest.mark.parametrize("seed", range(30))
def test_three_classes_give_the_papers_expanded_formula(seed: int) -> None:
    task = random_task(seed, target="achieve", counts=(seed % 4, seed // 4 % 4))
    plan = plan_of(task)
    found = evaluate(task, random_signals(seed, task, (20,)))
    safety, target = found.scores[: plan.safety_count], found.scores[plan.safety_count]
    comfort = found.scores[plan.comfort_start :]
    whole = np.prod(safety, axis=0)
    expected = safety.sum(0) + whole * target + whole * target * comfort.sum(0)
    np.testing.assert_allclose(found.potential, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(30))
def test_every_order_gives_products_over_all_that_is_more_important(seed: int) -> None:
    task = random_task(seed, counts=(3, 3), preferences=4)
    signals = random_signals(seed, task, (20,))
    found = scores(task, signals)
    expected = 0.0
    for label in task.labels:
        weight = 1.0
        for above in task.order.above[label]:
            weight = weight * found[above]
        expected = expected + weight * found[label]
    np.testing.assert_allclose(potential(task, signals), expected, atol=1e-12)


@pytest.mark.parametrize("spread", [1.0, 10.0])
@pytest.mark.parametrize("seed", range(20))
def test_potential_lies_between_zero_and_the_number_of_requirements(
    seed: int, spread: float
) -> None:
    task = random_task(seed, counts=(2, 3), preferences=seed % 4, depth=2)
    signals = random_signals(seed, task, (50,), spread=spread)
    found = evaluate(task, signals)
    assert np.all((found.scores >= 0.0) & (found.scores <= 1.0))
    assert np.all((found.potential >= 0.0) & (found.potential <= len(task.requirements) + 1e-12))


def test_signals_far_outside_their_ranges_clip_scores_and_not_margins(driving: Task) -> None:
    far = HALFWAY | {"lap": -1e9, "v": 1e9, "alpha": 1e9}
    found = evaluate(driving, as_batch(far))
    assert margins(driving, far)["finish"] == -1e9 - 1.0
    assert scores(driving, far)["finish"] == scores(driving, far)["slow"] == 0.0
    assert found.potential.tolist() == [potential(driving, as_batch(far))[0]] == [1.0]


@pytest.mark.parametrize("seed", range(20))
def test_losing_one_safety_requirement_removes_all_below_it(seed: int) -> None:
    task = random_task(seed, target="conquer", counts=(3, 2))
    plan = plan_of(task)
    found = evaluate(task, random_signals(seed, task, (200,)))
    lost = ~np.all(found.satisfied[: plan.safety_count], axis=0)
    safety = found.scores[: plan.safety_count].sum(0)
    assert np.array_equal(found.potential[lost], safety[lost])


@pytest.mark.parametrize("seed", range(20))
def test_the_order_of_the_text_changes_nothing(seed: int) -> None:
    task = random_task(seed, counts=(2, 3), preferences=seed % 4)
    signals = random_signals(seed, task, (30,))
    shuffled = list(task.requirements)
    np.random.default_rng(seed).shuffle(shuffled)  # type: ignore[arg-type]
    other = replace(task, requirements=tuple(shuffled))
    np.testing.assert_allclose(potential(other, signals), potential(task, signals), atol=1e-12)
    assert list(margins(other, signals)) == list(other.labels)
    for label, margin in margins(task, signals).items():
        assert np.array_equal(margins(other, signals)[label], margin)


def test_a_chain_of_preferences_multiplies_all_weights_above() -> None:
    task = parse_task(
        """
        signal x in [0, 1]
        signal y in [0, 1]
        signal z in [0, 1]
        encourage third:  z >= 1
        encourage first:  x >= 1
        encourage second: y >= 1
        prefer first over second
        prefer second over third
        """
    )
    # Scores are the signals themselves: 0.5 + 0.5 * 0.4 + 0.5 * 0.4 * 0.3 = 0.76.
    state = {"x": 0.5, "y": 0.4, "z": 0.3}
    assert potential(task, state) == pytest.approx(0.76)
    assert potential(task, as_batch(state))[0] == pytest.approx(0.76)


STRICTNESS = [
    # predicate over x = y = 0, whether it holds
    ("x >= 0", True),
    ("x > 0", False),
    ("0 <= x", True),
    ("0 < x", False),
    ("x >= 0 and y >= 0", True),
    ("x >= 0 and y > 0", False),
    ("x > 0 or y >= 0", True),
    ("x > 0 or y > 0", False),
    ("(x > 0 or y >= 0) and y <= 0", True),
    ("(x > 0 or y >= 0) and y < 0", False),
    ("(x > 0 and y >= 0) or (y <= 0 and x >= 0)", True),
    ("(x > 0 and y >= 0) or (y <= 0 and x < 0)", False),
    ("0 <= x <= 1", True),
    ("0 < x <= 1", False),
]


@pytest.mark.parametrize(("predicate", "holds"), STRICTNESS)
@pytest.mark.parametrize("kind", ["ensure", "conquer", "encourage"])
def test_strictness_decides_at_a_margin_of_zero(predicate: str, holds: bool, kind: str) -> None:
    task = parse_task(
        f"signal x in [-1, 1]\nsignal y in [-1, 1]\n{kind} r: {predicate}\nensure s: x <= 0.5"
    )
    row = plan_of(task).labels.index("r")
    for state in ({"x": 0.0, "y": 0.0}, as_batch({"x": 0.0, "y": 0.0})):
        found = evaluate(task, state)
        assert np.all(np.asarray(found.satisfied[row]) == holds)
        assert np.all(np.asarray(task.margins(state)["r"]) == 0.0)
        # A continuous score has no strictness: it is 1 at a margin of 0.
        expected = 1.0 if kind != "ensure" else float(holds)
        assert np.all(np.asarray(scores(task, state)["r"]) == expected)


def test_all_comparisons_strict() -> None:
    task = parse_task("signal x in [-1, 1]\nachieve r: x > 0")
    assert evaluate(task, {"x": np.zeros(2)}).satisfied.tolist() == [[False, False]]


def test_scores_of_and_and_or_are_those_of_the_parts_not_of_the_margin() -> None:
    # x: margin -1, l = -10, score 0.9; y: margin -0.5, l = -1, score 0.5.
    for connective, margin, score in (("and", -1.0, 0.5), ("or", -0.5, 0.9)):
        task = parse_task(
            f"signal x in [0, 20]\nsignal y in [0, 2]\nencourage r: x >= 10 {connective} y >= 1"
        )
        state = {"x": 9.0, "y": 0.5}
        for one in (state, as_batch(state)):
            assert np.ravel(margins(task, one)["r"]) == pytest.approx([margin])
            assert np.ravel(scores(task, one)["r"]) == pytest.approx([score])


def test_always_true_has_score_one_even_outside_the_range() -> None:
    with_bound = parse_task("signal x in [0, 1]\nencourage r: x >= 0")
    assert with_bound.bounds["r"] == (0.0, 1.0)
    for state in ({"x": -5.0}, {"x": np.asarray([-5.0])}):
        assert np.all(np.asarray(potential(with_bound, state)) == 1.0)


@pytest.mark.parametrize("convert", [float, np.float64, np.asarray, jnp.asarray, torch.tensor])
@pytest.mark.parametrize(
    ("value", "expected"),
    [(-math.inf, [1.0, 0.0]), (math.inf, [1.0, 1.0]), (math.nan, [math.nan] * 2)],
)
def test_an_infinite_signal_has_scores_and_nan_has_none(
    convert: Any, value: float, expected: list[float]
) -> None:
    task = parse_task("signal x in [0, 1]\nencourage always: x >= 0\nencourage half: x >= 0.5\n")
    state = {"x": convert([value]) if convert not in (float, np.float64) else convert(value)}
    found = [np.asarray(score).item() for score in scores(task, state).values()]
    np.testing.assert_array_equal(found, expected)


def test_empty_classes_and_tasks() -> None:
    nothing = Task()
    for state in ({}, {"unused": 1.0}):
        assert potential(nothing, state) == 0.0
    found = evaluate_arrays(plan_of(nothing), {}, np)
    assert (found.margins.shape, found.potential) == ((0,), 0.0)
    only_constants = parse_task("ensure always: 1 > 0")
    assert potential(only_constants, {}) == 1.0
    assert evaluate_arrays(plan_of(only_constants), {}, np).satisfied.tolist() == [True]
    only_safety = parse_task(
        "signal x in [-1, 1]\nensure either: x > 0 or x < -0.5\nensure low: x < 0.9"
    )
    assert potential(only_safety, {"x": np.asarray([0.5, 0.0, -0.7])}).tolist() == [2.0, 1.0, 2.0]


def test_nan_propagates() -> None:
    task = parse_task(
        "signal x in [-1, 1]\nsignal y in [-1, 1]\nachieve r: x >= 0 and y >= 0\nencourage c: x >= 0"
    )
    state = {"x": math.nan, "y": 0.5}
    assert math.isnan(potential(task, state))
    assert np.isnan(potential(task, as_batch(state))).all()


X = "signal x in [-5, 5]\n"
LONG = {
    "or": X + "ensure r: " + " or ".join(f"x <= {i % 4}" for i in range(1500)),
    "chain": X + "ensure r: " + " <= ".join(["x", *(f"{3 + 7 * i}" for i in range(1400))]),
    "definitions used once": X
    + "let a0 = x\n"
    + "".join(f"let a{i + 1} = -a{i}\n" for i in range(1200))
    + "ensure r: a1200 <= 3",
    "nested definitions used once": X
    + "let a0 = x\n"
    + "".join(f"let a{i + 1} = {'mean(0, 2 * ' * 45}a{i}{')' * 45}\n" for i in range(40))
    + f"ensure r: {'mean(0, 2 * ' * 45}a40{')' * 45} <= 3",
}
"""Tasks that take thousands of operations one after the other."""


@pytest.mark.parametrize("text", LONG.values(), ids=LONG)
def test_the_length_of_a_task_is_not_the_depth_of_its_evaluation(text: str) -> None:
    task = parse_task(text)
    assert margins(task, {"x": 1.0}) == {"r": 2.0}
    assert scores(task, {"x": 4.0}) == {"r": 0.0}
    batch = {"x": np.asarray([1.0, 4.0])}
    assert margins(task, batch)["r"].tolist() == [2.0, -1.0]
    assert assess(task, batch).pam == 0.75


def test_a_missing_signal_is_named(driving: Task) -> None:
    state = dict(HALFWAY)
    state["wall"] = state.pop("walls")
    with pytest.raises(SignalError, match=r"signal 'walls' is missing\. Did you mean 'wall'\?"):
        evaluate(driving, state)


def test_signals_that_no_requirement_reads_are_not_needed() -> None:
    task = parse_task("signal x in [0, 1]\nsignal idle in [0, 1]\nachieve r: x >= 0.5")
    assert plan_of(task).signals == ("x",)
    assert potential(task, {"x": 1.0}) == 1.0


def test_signals_are_a_dictionary(driving: Task) -> None:
    with pytest.raises(
        SignalError, match=r"signals are a dictionary from name to value, got \[1\]"
    ):
        driving.margins([1])  # type: ignore[arg-type]


def test_evaluated_signals_are_not_evaluated_again(driving: Task) -> None:
    carried = dict(HALFWAY)
    carry(carried, driving, evaluate(driving, CRASHED))
    assert potential(driving, carried) == 0.0
    other = parse_task("signal v in [0, 5]\nachieve r: v >= 2")
    assert potential(other, carried) == 0.5
