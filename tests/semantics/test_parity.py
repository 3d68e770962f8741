"""Floats, NumPy, JAX and PyTorch give the same numbers, and interval arithmetic bounds them."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs import parse_task
from hprs.semantics.evaluation import Evaluation, evaluate, evaluate_floats
from hprs.semantics.plan import plan_of
from hprs.spec.task import Task
from tests.semantics.random_tasks import random_signals, random_task

SHAPES = ((), (5,), (2, 3))


def task_of(seed: int) -> Task:
    return random_task(seed, preferences=seed % 3)


def agree(found: Evaluation, expected: Evaluation, tolerance: float = 1e-9) -> None:
    assert [np.shape(part) for part in found] == [np.shape(part) for part in expected]
    margins = np.asarray(expected.margins)
    np.testing.assert_allclose(np.asarray(found.margins), margins, rtol=tolerance, atol=tolerance)
    # Where a margin is 0 up to rounding, rounding decides.
    decided = np.all(np.abs(margins) > 10 * tolerance, axis=0)
    for field in ("satisfied", "scores", "potential"):
        a, b = (np.asarray(getattr(each, field), float)[..., decided] for each in (found, expected))
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance, err_msg=field)


@pytest.mark.parametrize("seed", range(90))
def test_floats_and_numpy_agree_and_margins_lie_in_their_bounds(seed: int) -> None:
    task = task_of(seed)
    shape = SHAPES[seed % 3]
    signals = random_signals(seed, task, shape)
    whole = evaluate(task, signals)
    for label, margin in task.margins(signals).items():
        low, high = task.bounds[label]
        slack = 1e-9 * max(1.0, *(abs(end) for end in (low, high) if np.isfinite(end)))
        assert margin.shape == shape
        assert np.all((margin >= low - slack) & (margin <= high + slack)), label
    for index in np.ndindex(shape):
        one = {name: value[index] for name, value in signals.items()}
        one = {name: float(v) if np.ndim(v) == 0 else v for name, v in one.items()}
        alone = evaluate_floats(plan_of(task), one)
        assert all(type(margin) is float for margin in alone.margins.values())
        assert all(type(holds) is bool for holds in alone.satisfied)
        alone = alone._replace(margins=[*alone.margins.values()], scores=[*alone.scores.values()])
        agree(alone, Evaluation(*(np.asarray(part)[(..., *index)] for part in whole)))


@pytest.mark.parametrize("seed", range(60))
def test_pytorch_agrees_with_numpy(seed: int) -> None:
    task = task_of(seed)
    signals = random_signals(seed, task, SHAPES[seed % 3])
    found = evaluate(task, {name: torch.asarray(value) for name, value in signals.items()})
    assert isinstance(found.potential, torch.Tensor)
    agree(found, evaluate(task, signals))


@pytest.mark.parametrize("seed", range(16))
def test_jax_under_jit_and_vmap_agrees_with_numpy(seed: int) -> None:
    task = random_task(seed, depth=2, preferences=seed % 3)
    shape = SHAPES[seed % 3]
    signals = random_signals(seed, task, shape)

    def whole(values: dict[str, Any]) -> Evaluation:
        return evaluate(task, values)

    with jax.enable_x64(True):
        values = {name: jnp.asarray(value) for name, value in signals.items()}
        function = jax.vmap(whole, out_axes=Evaluation(1, 1, 1, 0)) if shape else whole
        found = jax.jit(function)(values)
        agree(found, evaluate(task, signals))
        if seed < 3:
            agree(evaluate(task, values), evaluate(task, signals))


def test_jax_in_single_precision_is_close(driving: Task) -> None:
    signals = random_signals(3, driving, (4, 6))
    found = jax.jit(lambda values: evaluate(driving, values))(
        {name: jnp.asarray(value, dtype=jnp.float32) for name, value in signals.items()}
    )
    assert found.potential.dtype == jnp.float32
    agree(found, evaluate(driving, signals), tolerance=1e-5)


def test_single_precision_stays_single_precision(driving: Task) -> None:
    signals = random_signals(3, driving, (4,))
    for convert in (np.float32, lambda v: torch.asarray(v, dtype=torch.float32)):
        found = evaluate(driving, {name: convert(value) for name, value in signals.items()})
        for part in (found.margins, found.scores, found.potential):
            assert str(part.dtype).endswith("float32")
        agree(found, evaluate(driving, signals), tolerance=1e-5)


def test_constants_stay_where_the_signals_are() -> None:
    task = parse_task(
        "signal x in [-1, 1]\nachieve there: x > 0.5 or x <= -0.5\nensure fixed: 1 >= 0"
    )
    found = evaluate(task, {"x": torch.zeros(3, device="meta")})
    assert found.potential.device.type == "meta"
    assert found.potential.shape == (3,)


def test_numbers_and_arrays_mix() -> None:
    task = parse_task("signal x in [-1, 1]\nsignal y in [-1, 1]\nachieve there: x + y >= 0.5")
    for array in (np.asarray([0, 1]), torch.asarray([0, 1]), jnp.asarray([0, 1])):
        # y = 0.25: margins -0.25 and 0.75, l = -2.5.
        found = evaluate(task, {"x": array, "y": 0.25})
        np.testing.assert_allclose(np.asarray(found.potential), [0.9, 1.0], rtol=1e-6)


def test_whole_numbers_and_truth_values_are_signals_too() -> None:
    task = parse_task("signal hit in [0, 1]\nensure unharmed: hit < 0.5")
    for value in (True, np.True_, np.asarray(1), torch.asarray(True), jnp.asarray(True)):
        assert not np.asarray(evaluate(task, {"hit": value}).satisfied)[0]
