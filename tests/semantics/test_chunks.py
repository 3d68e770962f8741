"""A trace in pieces is assessed as the whole; what it lacks makes unknown what needs it."""

from __future__ import annotations

import itertools
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hprs import assess, parse_task, summarise
from hprs.errors import TraceError, UsageError
from hprs.semantics.assessment import Assessment
from hprs.semantics.chunks import assess_chunks
from hprs.semantics.plan import plan_of
from tests.semantics.random_tasks import random_signals, random_task
from tests.semantics.test_assessment import PARK, RACE, SIGNALS

NAN = float("nan")


def pieces(trace: dict[str, Any], cuts: list[int]) -> list[dict[str, Any]]:
    ends = [0, *sorted(cuts), len(next(iter(trace.values())))]
    return [{k: v[i:j] for k, v in trace.items()} for i, j in itertools.pairwise(ends)]


@given(seed=st.integers(0, 10**6), data=st.data())
def test_a_trace_in_pieces_is_assessed_as_the_whole(seed: int, data: Any) -> None:
    task = random_task(seed)
    steps = data.draw(st.integers(2, 12))
    trace = random_signals(seed, task, (steps,), spread=1.5)
    cuts = data.draw(st.lists(st.integers(0, steps), max_size=5))
    if not plan_of(task).signals:
        with pytest.raises(TraceError, match="the task reads no signal"):
            assess_chunks(task, pieces(trace, cuts))
        return
    whole = assess(task, trace)
    assert assess_chunks(task, pieces(trace, cuts)) == whole
    # A margin of NaN, outside the range of its expression, is unknown; the others stay.
    partial = assess(task, trace, missing="unknown")
    for label, found in partial.requirements.items():
        assert found in (None, whole.requirements[label])


@given(seed=st.integers(0, 10**6), data=st.data())
def test_what_is_known_holds_whatever_the_missing_values_are(seed: int, data: Any) -> None:
    task = random_task(seed)
    if not plan_of(task).signals:
        return
    steps = data.draw(st.integers(2, 6))
    trace = random_signals(seed, task, (steps,))
    whole = assess(task, trace)
    gone = data.draw(st.lists(st.sampled_from(list(trace)), max_size=2, unique=True))
    holes = {name: value.copy() for name, value in trace.items() if name not in gone}
    for name in data.draw(st.lists(st.sampled_from(list(trace)), max_size=2)):
        if name in holes:
            holes[name][data.draw(st.integers(0, steps - 1))] = NAN
    if not holes.keys() & set(plan_of(task).signals):
        return
    cuts = data.draw(st.lists(st.integers(0, steps), max_size=3))
    found = assess_chunks(task, pieces(holes, cuts), missing="unknown")
    assert found == assess(task, holes, missing="unknown")
    for label, measured in found.requirements.items():
        assert measured in (None, whole.requirements[label])
    for name in ("safe", "target", "comfort", "satisfied", "decided_at_start"):
        assert getattr(found, name) in (None, getattr(whole, name)), name
    assert found.pam == (None if found.unknown else whole.pam)


def unknown(text: str, trace: dict[str, Any]) -> Assessment:
    return assess(parse_task(text), trace, missing="unknown")


def test_a_missing_signal_makes_unknown_what_needs_it() -> None:
    found = unknown(RACE, {"x": [0.0, 0.6, 0.7]})
    assert found.requirements == {"e": None, "t": True, "c": None, "d": 1.0}
    assert found.unknown == ("e", "c")
    assert (found.pam, found.safe, found.target, found.comfort) == (None, None, True, None)
    assert (found.satisfied, found.decided_at_start, found.length) == (None, None, 2)


def test_one_violation_decides_safety_whatever_is_missing() -> None:
    found = unknown(RACE, {"x": [0.0, 0.6, 0.7], "y": [NAN, -0.9, NAN]})
    assert (found.safe, found.satisfied, found.requirements["e"]) == (False, False, False)
    assert found.decided_at_start is None
    assert unknown(RACE, {"x": [0.0, 0.6], "y": [-0.9, NAN]}).decided_at_start is True
    assert unknown(RACE, {"x": [0.6, 0.6], "y": [NAN, 0.0]}).decided_at_start is True
    assert unknown(RACE, {"x": [NAN, 0.6], "y": [0.0, 0.0]}).decided_at_start is None


def test_a_target_is_decided_by_the_states_that_count() -> None:
    y = [0.0, 0.0, 0.0]
    assert unknown(RACE, {"x": [0.0, 0.6, NAN], "y": y}).target is True
    assert unknown(PARK, {"x": [0.0, 0.6, NAN], "y": y}).target is None
    assert unknown(PARK, {"x": [0.0, NAN, 0.6], "y": y}).pam is None
    assert unknown(PARK, {"x": [0.0, NAN, 0.6], "y": y}).safe is True
    failed = unknown(RACE, {"x": [0.0, 0.1, 0.2]})
    assert (failed.target, failed.satisfied, failed.safe) == (False, False, None)


def test_one_side_of_an_or_can_be_enough() -> None:
    text = SIGNALS + "ensure e: x <= 0.5 or y <= 0.5\nencourage c: x <= 0.5 and y <= 0.5"
    assert unknown(text, {"x": [0.0, 0.1]}).requirements == {"e": True, "c": None}
    assert unknown(text, {"x": [0.9, 0.9]}).requirements == {"e": None, "c": 0.0}


def test_a_missing_vector_is_unknown_in_every_namespace() -> None:
    text = "signal p[2] in [0, 1]\nsignal x in [0, 1]\nensure e: max(p) <= 0.5\nensure f: x <= 0.5"
    for asarray in (np.asarray, jnp.asarray, torch.asarray):
        found = unknown(text, {"x": asarray([0.0, 1.0])})
        assert found.requirements == {"e": None, "f": False}
        found = unknown(text, {"p": asarray([[0.0, 0.0], [0.9, 0.0]])})
        assert found.requirements == {"e": False, "f": None}
    assert unknown(text, {"p": [[0.0, 0.0], [NAN, 0.0]], "x": [0, 0]}).unknown == ("e",)


def test_padding_and_ranges_are_those_of_the_whole() -> None:
    task = parse_task(RACE)
    trace = {"x": [0.0, 3.0, 0.6], "y": [2.0, 0.0, 2.0]}
    found = assess_chunks(task, pieces(trace, [1, 2]), max_length=10)
    assert found == assess(task, trace, max_length=10)
    assert found.outside == {"x": 1, "y": 2}


@pytest.mark.parametrize(
    ("chunks", "message"),
    [
        ([], "the trace needs the initial state and at least one step"),
        ([{"x": [0.0], "y": [0.0]}], "the trace needs the initial state and at least one step"),
        ([{"x": [], "y": []}], "the trace needs the initial state and at least one step"),
        ([{"x": [0, 0, 0], "y": [0, 0, 0]}, {"x": [0, NAN], "y": [0, 0]}], "'x' is NaN at step 4"),
        ([{"x": [0, 0], "z": [0, 0]}], "no signal 'y'; it has x, z. With missing='unknown' the"),
        ([{"x": [0, 0], "ye": [0, 0]}], "Did you mean 'ye'?"),
    ],
)  # fmt: skip
def test_pieces_that_cannot_be_assessed(chunks: list[Any], message: str) -> None:
    with pytest.raises(TraceError, match=message.replace("?", r"\?")):
        assess_chunks(parse_task(RACE), chunks)


def test_unknown_is_one_trace_with_at_least_one_signal() -> None:
    with pytest.raises(UsageError, match="is assessed alone"):
        unknown(RACE, {"x": np.zeros((3, 2))})
    with pytest.raises(TraceError, match=r"none of the signals .* \(x, y\); it has z"):
        unknown(RACE, {"z": [0, 0]})
    with pytest.raises(UsageError, match="missing is error or unknown, got 'unknowns'"):
        assess(parse_task(RACE), {}, missing="unknowns")  # type: ignore[arg-type]


def test_unknown_requirements_are_not_summarised() -> None:
    known = assess(parse_task(RACE), {"x": [0.0, 0.6], "y": [0.0, 0.0]})
    with pytest.raises(UsageError, match=r"episode 1 cannot .* whether e, c is met"):
        summarise([known, unknown(RACE, {"x": [0.0, 0.6]})])
