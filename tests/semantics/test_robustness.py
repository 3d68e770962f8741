"""Robustness of whole traces, by hand."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs import parse_task
from hprs.errors import TraceError, UsageError
from hprs.semantics.evaluation import scores
from hprs.semantics.robustness import formula, robustness

TASK = parse_task(
    """
    signal x in [-4, 4]
    signal y in [0, 1]
    encourage calm: abs(x) <= 1
    ensure    near: abs(x) <= 2 or y > 0.5
    conquer   goal: y >= 0.75 and x >= 0
    """
)
X, Y = [0.0, 3.0, 1.0], [0.25, 1.0, 0.8]
# calm: 1, -2, 0; near: max(2, -0.25), max(-1, 0.5), max(1, 0.3); goal in the end: min(0.05, 1).
RAW = {"calm": -2.0, "near": 0.5, "goal": 0.05}
# Each comparison by its bound: calm in [-3, 1]; near: -1 / 2 and 0.5 / 0.5; goal: 0.05 / 0.25, 1 / 4.
NORMALISED = {"calm": -2 / 3, "near": 0.6, "goal": 0.2}


@pytest.mark.parametrize("convert", [list, np.asarray, jnp.asarray, torch.asarray])
def test_by_hand(convert) -> None:
    trace = {"x": convert(X), "y": convert(Y)}
    raw, normalised = robustness(TASK, trace), robustness(TASK, trace, margins="normalised")
    assert list(raw) == ["calm", "near", "goal"]
    for label in TASK.labels:
        assert float(raw[label]) == pytest.approx(RAW[label], abs=1e-6)
        assert float(normalised[label]) == pytest.approx(NORMALISED[label], abs=1e-6)


def test_batches_have_time_first() -> None:
    trace = {"x": np.stack([X, X[::-1]], axis=1), "y": np.stack([Y, Y[::-1]], axis=1)}
    found = robustness(TASK, trace)
    assert found["goal"] == pytest.approx([0.05, -0.5])
    assert found["near"] == pytest.approx([0.5, 0.5])


def test_an_achieved_target_is_worth_its_best_state() -> None:
    task = parse_task("signal x in [-4, 4]\nachieve far: x >= 2")
    assert robustness(task, {"x": X})["far"] == 1.0
    assert robustness(task, {"x": X}, margins="normalised")["far"] == 0.5


def test_a_bound_on_the_wrong_side_of_0_is_replaced_by_the_other_one() -> None:
    task = parse_task(
        "signal x in [0, 1]\nensure a: x <= 3\nencourage b: x <= 0\nensure c: 0 <= 0 or x <= 0.5"
    )
    # a is 2.5 in [2, 3]; b is -0.5 in [-1, 0], and 2 where x is; `c` is 0 whatever x.
    found = robustness(task, {"x": [0.5, 0.5]}, margins="normalised")
    assert found == pytest.approx({"a": 2.5 / 3, "b": -0.5, "c": 0.0})
    found = robustness(task, {"x": [-2.0, -2.0]}, margins="normalised")
    assert found == pytest.approx({"a": 1.0, "b": 1.0, "c": 1.0})
    found = robustness(task, {"x": [4.5, 4.5]}, margins="normalised")
    assert found == pytest.approx({"a": -0.5, "b": -1.0, "c": 0.0})


def test_normalised_below_0_is_the_score_minus_1() -> None:
    task = parse_task("signal x in [-4, 4]\nencourage calm: abs(x) <= 1")
    for x in np.linspace(-6, 6, 25):
        found = robustness(task, {"x": [x, x]}, margins="normalised")["calm"]
        assert min(found, 0.0) == pytest.approx(scores(task, {"x": float(x)})["calm"] - 1.0)


def test_the_formula_is_safety_and_target() -> None:
    assert [(part.operator, part.rows) for part in formula(TASK)] == [
        ("always", (0,)),
        ("eventually always", (1,)),
    ]
    assert formula(parse_task("signal x in [0, 1]\nencourage a: x <= 0.5")) == ()


def test_wrong_arguments_are_one_line() -> None:
    with pytest.raises(UsageError, match="normalised or raw"):
        robustness(TASK, {"x": X, "y": Y}, margins="scaled")  # type: ignore[arg-type]
    with pytest.raises(TraceError, match="no signal 'y'"):
        robustness(TASK, {"x": X})
    unbounded = parse_task("signal x in [0, inf]\nensure a: x <= 0.5")
    assert robustness(unbounded, {"x": [0.0, 2.0]}) == {"a": -1.5}
    with pytest.raises(UsageError, match="choose margins='raw'"):
        robustness(unbounded, {"x": [0.0, 2.0]}, margins="normalised")
