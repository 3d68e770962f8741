"""What is a trace, and what is said of one that is none."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs import assess, parse_task
from hprs.errors import TraceError
from hprs.semantics.chunks import assess_chunks
from hprs.semantics.evaluation import evaluate
from hprs.spec.task import Task
from tests.semantics.test_assessment import GOOD, RACE

BAD_TRACES = [
    ({"x": [0.0, 0.0]}, "the trace has no signal 'y'; it has x"),
    (GOOD | {"x": [0.0] * 3}, r"the signals of the trace differ in length: \{'x': 3, 'y': 2\}"),
    (GOOD | {"y": [0.0, float("nan")]}, "signal 'y' is NaN at step 1 of the trace"),
    ({"x": [0.0], "y": [0.0]}, "the trace needs the initial state and at least one step"),
    ({"x": 0.0, "y": 0.0}, "the trace needs the initial state and at least one step"),
    (
        GOOD | {"y": [0.0, "fast"]},
        "in the trace, signal 'y' must hold numbers, but is 'fast' at step 1",
    ),
    (
        GOOD | {"y": np.asarray(["0", "fast"])},
        "signal 'y' must hold numbers, but is .*'0'.* at step 0",
    ),
    (GOOD | {"y": [0.0, {}]}, "signal 'y' must hold numbers, but is {} at step 1"),
    (GOOD | {"y": "log"}, "signal 'y' must hold numbers, but is 'log'"),
    (GOOD | {"y": object()}, "signal 'y' must hold numbers, but is <object"),
    (GOOD | {"y": [0.0, None]}, "signal 'y' must hold numbers, but is None at step 1"),
    (GOOD | {"y": ["0", "1"]}, "signal 'y' must hold numbers, but is '0' at step 0"),
    (GOOD | {"y": np.asarray([0, None], object)}, "must hold numbers, but is None at step 1"),
    (GOOD | {"y": [0.0, 1j]}, "must hold numbers, but is 1j at step 1"),
    (GOOD | {"y": np.asarray([0.0, 1j])}, "signal 'y' must hold numbers, but is .*j.* at step 0"),
    (GOOD | {"y": jnp.asarray([0.0, 1j])}, "signal 'y' must hold numbers, but is"),
    (GOOD | {"y": torch.asarray([0.0, 1j])}, "signal 'y' must hold numbers, but is"),
    (GOOD | {"y": np.asarray(["2020-01-01", "2020-01-02"], "datetime64[D]")}, "must hold numbers"),
    (GOOD | {"y": np.asarray([1, 2], "timedelta64[s]")}, "must hold numbers"),
    (GOOD | {"y": np.ma.array([0.0, 1.0], mask=[0, 1])}, "signal 'y' is a masked array. Fill or"),
    (
        GOOD | {"y": [[0.0, 0.0], [0.0, 0.0], [0.0]]},
        r"signal 'y' has shape \(1,\) at step 2, after shape \(2,\)",
    ),
    ([0.0, 0.0], r"a trace maps names of signals to values over time, got \[0.0, 0.0\]"),
    (
        GOOD | {"x": np.zeros((2, 2))},
        r"signal 'y' has shape \(2,\) in the trace, .* 'x' of shape \(2, 2\)",
    ),
]


@pytest.mark.parametrize(("trace", "message"), BAD_TRACES)
def test_traces_that_cannot_be_assessed(trace: dict[str, Any], message: str) -> None:
    with pytest.raises(TraceError, match=message):
        assess(parse_task(RACE), trace)


def test_what_numpy_can_read_is_a_trace() -> None:
    class Column:
        """As a column of a table."""

        shape = (2,)

        def to_numpy(self) -> None: ...

        def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
            return np.asarray([0.0, 0.6], dtype)

    class Scalars:
        """As an array of a library that nobody knows."""

        shape = (2,)
        __array__ = Column.__array__

    task = parse_task(RACE)
    y = [0, True]
    numbers = np.asarray([Decimal(0), Fraction(3, 5)], object)
    for x in ((0.0, 0.6), numbers, Column(), Scalars(), [np.float16(0), np.int8(1)]):
        assert assess(task, {"x": x, "y": y}).pam == 1.75
    for x in (jnp.asarray([0, 1], jnp.bfloat16), torch.asarray([0, 1])):
        assert assess(task, {"x": x, "y": x}).pam == 1.75


def test_numpy_is_assessed_in_the_precision_of_the_wrappers() -> None:
    task = parse_task("signal x in [-1, 1]\nensure r: x <= 0.05")
    single = np.asarray([0.0, 0.05], np.float32)
    # The float32 nearest to 0.05 is larger than 0.05.
    assert evaluate(task, {"x": float(single[1])}).satisfied == [False]
    for x in (single, single.astype(float), list(single)):
        assert assess(task, {"x": x}).safe is False
    for x in (jnp.asarray(single), torch.asarray(single)):
        assert assess(task, {"x": x}).safe is True


def test_a_vector_of_another_length_cannot_be_assessed() -> None:
    task = parse_task("signal p[3] in [0, 1]\nencourage c: max(p) <= 0.5")
    for value in (np.zeros((4, 2)), np.zeros(4)):
        with pytest.raises(TraceError, match="signal 'p' has 3 components"):
            assess(task, {"p": value})


def test_a_task_without_signals_has_no_trace() -> None:
    trace = {"x": [0.0, 0.5]}
    constants = parse_task("signal x in [0, 1]\nensure always: 1 > 0")
    for task in (Task(), constants):
        for recorded in ({}, trace):
            with pytest.raises(TraceError, match="the task reads no signal, so that a trace says"):
                assess(task, recorded)


UNDEFINED = parse_task("signal x in [0, 1]\nencourage b: x >= 0\nensure a: sqrt(x) <= 0.9")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("asarray", [np.asarray, jnp.asarray, torch.asarray])
def test_a_margin_that_is_nan_is_refused(asarray: Any) -> None:
    message = "the margin of requirement 'a' is NaN at step 2: a signal has left the range"
    trace = asarray([0.5, 0.5, -0.2, 0.5])
    with pytest.raises(TraceError, match=message):
        assess(UNDEFINED, {"x": trace})
    with pytest.raises(TraceError, match=message):
        assess(UNDEFINED, {"x": asarray([[0.5, 0.5], [0.5, 0.5], [0.5, -0.2]])})
    for cut in range(5):
        with pytest.raises(TraceError, match=message):
            assess_chunks(UNDEFINED, [{"x": trace[:cut]}, {"x": trace[cut:]}])
    found = assess(UNDEFINED, {"x": trace}, missing="unknown")
    assert (found.unknown, found.safe) == (("a",), None)


def test_a_margin_that_is_nan_is_refused_beside_or() -> None:
    task = parse_task("signal x in [0, 1]\nensure o: x <= 1\nensure a: x <= 0.9 or sqrt(x) <= 0.9")
    trace = {"x": [0.5, -0.2]}
    message = "the margin of requirement 'a' is NaN at step 1"
    with pytest.raises(TraceError, match=message):
        assess(task, trace)
    with pytest.raises(TraceError, match=message):
        assess_chunks(task, [trace])
    assert assess(task, trace, missing="unknown").safe is True


def test_under_jit_a_margin_that_is_nan_does_not_hold() -> None:
    found = jax.jit(lambda x: assess(UNDEFINED, {"x": x}).safe)(jnp.asarray([0.5, -0.2]))
    assert not found
