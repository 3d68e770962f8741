"""Satisfaction, PAM and its summary: by hand, as properties, and step by step."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs import assess, parse_task, summarise
from hprs.errors import UsageError
from hprs.semantics.assessment import (
    Assessment,
    Tally,
    accomplished_comfort,
    achieved,
    advance,
    conclude,
    is_safe,
    start,
)
from hprs.semantics.evaluation import evaluate, evaluate_floats
from hprs.semantics.plan import plan_of
from tests.semantics.random_tasks import random_signals, random_task

SIGNALS = "signal x in [-1, 1]\nsignal y in [-1, 1]\n"
RACE = (
    SIGNALS + "ensure e: y >= -0.5\nachieve t: x >= 0.5\nencourage c: y >= 0\nencourage d: x >= 0"
)
PARK = RACE.replace("achieve", "conquer")
FREE = SIGNALS + "ensure e: y >= -0.5\nencourage c: y >= 0"


GOOD = {"x": [0.0, 0.0], "y": [0.0, 0.0]}


def fields(assessment: Assessment) -> dict[str, Any]:
    flat = dict(vars(assessment))
    return flat | {f"row {k}": v for k, v in flat.pop("requirements").items()} | {"outside": None}


def agree(found: Assessment, expected: Assessment) -> None:
    a, b = fields(found), fields(expected)
    assert a.keys() == b.keys()
    for name in a:
        if name != "outside":
            np.testing.assert_allclose(
                np.asarray(a[name], float), np.asarray(b[name], float), rtol=1e-6, err_msg=name
            )


def test_a_finished_race_by_hand() -> None:
    found = assess(
        parse_task(RACE), {"x": [-0.1, -0.2, 0.2, 0.6, 0.4], "y": [-0.4, 0.1, -0.1, 0.3, 0.2]}
    )
    # Safe in all five states; x >= 0.5 in s_3. Over s_1 .. s_4: c holds in 3 of 4, d in 3 of 4.
    assert found.requirements == {"e": True, "t": True, "c": 0.75, "d": 0.75}
    assert (found.safe, found.target, found.satisfied, found.comfort) == (True, True, True, 0.75)
    # 1 + 1/2 + 1/4 * 0.75
    assert found.pam == 1.6875
    assert (found.length, found.decided_at_start, found.outside) == (4, False, {})
    assert type(found.pam) is float and type(found.safe) is bool and type(found.length) is int


def test_padding_counts_missing_steps_as_violations() -> None:
    trace = {"x": [0.0, 0.6], "y": [0.1, 0.1]}
    task = parse_task(RACE)
    assert assess(task, trace).pam == 1.75
    # One of ten steps: comfort 0.1 each, F = 1.5 + 0.25 * 0.1.
    assert assess(task, trace, max_length=10).pam == pytest.approx(1.525)
    assert assess(task, trace, max_length=1).pam == 1.75
    with pytest.raises(ValueError, match="an episode has 2 steps, more than max_length=1"):
        assess(task, {"x": [0.0] * 3, "y": [0.0] * 3}, max_length=1)


def test_conquer_means_that_the_target_holds_in_the_last_state() -> None:
    y = [0.0, 0.0, 0.0]
    for x, met in (([0.6, 0.6, 0.4], False), ([0.0, 0.0, 0.5], True), ([0.6, 0.0, 0.6], True)):
        assert assess(parse_task(PARK), {"x": x, "y": y}).target is met
        assert assess(parse_task(RACE), {"x": x, "y": y}).target is True


def test_the_initial_state_counts_for_satisfaction_and_not_for_comfort() -> None:
    task = parse_task(RACE)
    unsafe = assess(task, {"x": [0.0, 0.6], "y": [-0.6, 0.0]})
    assert (unsafe.safe, unsafe.comfort, unsafe.pam) == (False, 1.0, 0.75)
    met = assess(task, {"x": [0.5, -0.1], "y": [0.0, 0.0]})
    assert (met.target, met.requirements["d"], met.pam) == (True, 0.0, 1.625)
    assert assess(task, {"x": [0.0, 0.0], "y": [-0.1, 0.0]}).comfort == 1.0


def test_an_episode_may_be_decided_at_its_start() -> None:
    later = [0.0, 0.0]
    cases = [
        (RACE, 0.0, 0.0, False),
        (RACE, 0.0, -0.6, True),
        (RACE, 0.6, 0.0, True),
        (PARK, 0.6, 0.0, False),
        (PARK, 0.6, -0.6, True),
        (FREE, 0.6, 0.0, False),
        (FREE, 0.6, -0.6, True),
    ]
    for text, x, y, decided in cases:
        task = parse_task(text)
        assert assess(task, {"x": [x, *later], "y": [y, *later]}).decided_at_start is decided
        tally = start(plan_of(task), evaluate(task, {"x": x, "y": y}).satisfied)
        assert tally.decided_at_start is decided


def test_empty_classes_count_as_satisfied() -> None:
    trace = {"x": [0.0, -1.0], "y": [0.0, -1.0]}
    no_target = assess(parse_task(FREE), trace)
    assert (no_target.target, no_target.safe, no_target.comfort) == (True, False, 0.0)
    assert no_target.pam == 0.5
    no_comfort = assess(parse_task(SIGNALS + "achieve t: x >= 0.5"), trace)
    assert (no_comfort.safe, no_comfort.target, no_comfort.comfort) == (True, False, 1.0)
    assert no_comfort.pam == 1.25
    only_comfort = assess(parse_task(SIGNALS + "encourage c: x >= 0"), trace)
    assert (only_comfort.pam, only_comfort.satisfied) == (1.5, True)


def test_values_outside_their_range_are_counted_by_signal() -> None:
    task = parse_task(
        "signal x in [-1, 1]\nsignal p[2] in [0, 1]\nsignal idle in [0, 1]\n"
        "ensure e: x >= -5\nencourage c: max(p) <= 0.5"
    )
    inside = {"x": [-1.0, 1.0], "p": [[0.0, 1.0], [0.2, 0.2]]}
    assert assess(task, inside).outside == {}
    # Three states, not four components: both components leave at once in the last.
    outside = {"x": [-1.5, 1.0, 1.0], "p": [[0.0, 1.1], [-0.1, 0.2], [2.0, 2.0]]}
    assert assess(task, outside).outside == {"x": 1, "p": 3}
    batch = {"x": np.asarray([[-2.0, 0.0], [3.0, 0.0]]), "p": np.zeros((2, 2, 2))}
    assert assess(task, batch).outside["x"].tolist() == [2, 0]


@pytest.mark.parametrize("seed", range(60))
def test_pam_lemma(seed: int) -> None:
    """F >= 1 iff safe, F >= 1.5 iff the task is satisfied, F <= 1.75."""
    task = random_task(seed, depth=2)
    if not plan_of(task).signals:
        task = random_task(seed + 1000, depth=2)
    trace = random_signals(seed, task, (4, 50))
    found = assess(task, trace)
    rows = dict(zip(plan_of(task).labels, evaluate(task, trace).satisfied, strict=True))
    by_kind = {kind: [] for kind in ("ensure", "achieve", "conquer", "encourage")}
    for requirement in task.requirements:
        by_kind[requirement.kind].append(rows[requirement.label])
    every = np.ones(50, bool)
    safe = np.all([every, *(row.all(0) for row in by_kind["ensure"])], axis=0)
    target = np.all(
        [every, *(r.any(0) for r in by_kind["achieve"]), *(r[-1] for r in by_kind["conquer"])],
        axis=0,
    )
    comfort = np.mean([row[1:].mean(0) for row in by_kind["encourage"]] or [every * 1.0], axis=0)
    assert np.array_equal(found.pam >= 1.0, safe)
    assert np.array_equal(found.pam >= 1.5, safe & target)
    assert np.array_equal(found.satisfied, safe & target)
    assert np.all(found.pam <= 1.75)
    np.testing.assert_allclose(found.pam, safe + target / 2 + comfort / 4)


@pytest.mark.parametrize("text", [RACE, PARK, FREE, SIGNALS + "achieve t: x >= 0.5"])
def test_step_by_step_gives_the_whole_trace(text: str) -> None:
    task, steps = parse_task(text), 6
    plan = plan_of(task)
    trace = random_signals(7, task, (steps, 40), spread=0.9)
    whole = assess(task, trace)

    alone = [
        {name: [float(v) for v in values[:, i]] for name, values in trace.items()}
        for i in range(40)
    ]
    for i, one in enumerate(alone):
        rows = [
            evaluate_floats(plan, {n: values[t] for n, values in one.items()}).satisfied
            for t in range(steps)
        ]
        tally = start(plan, rows[0])
        for row in rows[1:]:
            tally = advance(plan, tally, row)
        episode = conclude(plan, tally)
        assert episode == assess(task, one)
        assert episode.pam == whole.pam[i]
        assert is_safe(tally) is episode.safe
        assert achieved(plan, tally) is (plan.achieves and episode.target)

    for convert in (np.asarray, torch.asarray):
        arrays = {name: convert(values) for name, values in trace.items()}
        at = [evaluate(task, {n: v[t] for n, v in arrays.items()}).satisfied for t in range(steps)]
        tally = start(plan, at[0])
        for row in at[1:]:
            tally = advance(plan, tally, row)
        agree(conclude(plan, tally), whole)
        agree(assess(task, arrays), whole)
        assert np.array_equal(is_safe(tally), whole.safe)
        expected = whole.target if plan.achieves else np.zeros(40, bool)
        assert np.array_equal(achieved(plan, tally), expected)

    @jax.jit
    def scanned(values: dict[str, Any]) -> dict[str, Any]:
        rows = evaluate(task, values).satisfied
        first = start(plan, rows[:, 0])
        last, _ = jax.lax.scan(
            lambda tally, row: (advance(plan, tally, row), None),
            first,
            jnp.moveaxis(rows[:, 1:], 1, 0),
        )
        return vars(conclude(plan, last))

    arrays = {name: jnp.asarray(values, jnp.float32) for name, values in trace.items()}
    agree(Assessment(**scanned(arrays)), whole)
    agree(assess(task, arrays), whole)


@pytest.mark.parametrize("kind", ["achieve", "conquer"])
def test_a_batch_padded_to_its_longest_episode(kind: str) -> None:
    task = parse_task(SIGNALS + f"{kind} t: x >= 0.5\nencourage c: y >= 0")
    trace = {"x": np.zeros((3, 2)), "y": np.asarray([[0.0, 0.0], [0.0, -1.0], [0.0, 0.0]])}
    assert assess(task, trace, max_length=4).comfort.tolist() == [0.5, 0.25]


def test_summary_by_hand() -> None:
    task = parse_task(RACE)
    episodes = [
        assess(task, {"x": x, "y": y})
        for x, y in (
            ([0.0, 0.6], [0.0, 0.1]),  # accomplished, comfort 1: F = 1.75
            ([0.0, 0.1, 0.6], [0.0, -0.1, -0.1]),  # c in 0 of 2, d in 2 of 2: F = 1.625
            ([0.0, 0.1], [0.0, 0.1]),  # safe, target not met: F = 1.25
            ([0.0, 0.6], [0.0, -0.6]),  # crashed on target: c 0, d 1: F = 0.5 + 0.125
        )
    ]
    assert [episode.pam for episode in episodes] == [1.75, 1.625, 1.25, 0.625]
    found = summarise(episodes)
    assert (found.safe, found.safe_target, found.episodes) == (0.75, 0.5, 4)
    # (1 + 0.5 + 0 + 0) / 4
    assert found.safe_target_comfort == 0.375
    assert found.pam == 1.3125
    assert found.requirements == {"e": 0.75, "t": 0.75, "c": 0.5, "d": 1.0}
    assert accomplished_comfort(torch.asarray([1.4, 1.5, 1.75])).tolist() == [0.0, 0.0, 1.0]


def test_a_summary_needs_an_episode() -> None:
    for nothing in ([], iter(())):
        with pytest.raises(UsageError, match="there is no episode to summarise"):
            summarise(nothing)
    for wrong in (3, [3], "log"):
        with pytest.raises(
            UsageError, match=r"assessments are summarised, as of hprs\.assess; got"
        ):
            summarise(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("text", [RACE, FREE, SIGNALS + "ensure e: y >= -0.5"])
@pytest.mark.parametrize("convert", [np.asarray, jnp.asarray, torch.as_tensor])
def test_every_episode_of_a_batch_counts_in_a_summary(text: str, convert: Any) -> None:
    task = parse_task(text)
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 9, 3, 2))
    single = [assess(task, {"x": x[:, i, j], "y": y[:, i, j]}) for i in range(3) for j in range(2)]
    batch = assess(task, {"x": convert(x), "y": convert(y)})
    expected = summarise(iter(single))
    for found in (summarise(batch), summarise([batch])):
        assert found.episodes == expected.episodes == 6
        assert found.pam == pytest.approx(expected.pam, rel=1e-6)
        assert found.safe_target_comfort == pytest.approx(expected.safe_target_comfort, abs=1e-6)
        assert found.requirements == pytest.approx(expected.requirements, rel=1e-6)
    assert summarise([batch, *single]).episodes == 12


def test_episodes_of_different_tasks_have_no_summary() -> None:
    with pytest.raises(UsageError, match="of tasks with different requirements"):
        summarise([assess(parse_task(text), GOOD) for text in (RACE, FREE)])


def test_padding_under_jit_and_vmap() -> None:
    plan = plan_of(parse_task(RACE))

    def padded(steps: Any, counts: Any) -> Any:
        tally = Tally(jnp.asarray([True]), jnp.asarray(True), counts, steps, jnp.asarray(False))
        return conclude(plan, tally, max_length=8).pam

    counts = jnp.asarray([4, 2])
    assert float(jax.jit(padded)(jnp.asarray(6), counts)) == pytest.approx(1.5 + 0.25 * 3 / 8)
    found = jax.vmap(padded, in_axes=(0, None))(jnp.asarray([6, 8, 9]), counts)
    assert np.isfinite(np.asarray(found)).tolist() == [True, True, False]
    with pytest.raises(ValueError, match="an episode has 9 steps, more than max_length=8"):
        padded(jnp.asarray([6, 9]), counts[:, None])


def test_a_trace_is_assessed_under_jit_and_vmap() -> None:
    task = parse_task(RACE)

    def found(trace: dict[str, Any]) -> dict[str, Any]:
        whole = vars(assess(task, trace, max_length=8))
        assert whole["outside"] == {}
        return whole

    x = np.random.default_rng(1).uniform(-2.0, 2.0, (6, 3))
    trace = {"x": jnp.asarray(x), "y": jnp.asarray(0.5 * x)}
    expected = assess(task, trace, max_length=8)
    agree(Assessment(**jax.jit(found)(trace)), expected)
    agree(Assessment(**jax.vmap(found, in_axes=1)(trace)), expected)
    one = {name: column[:, 0] for name, column in trace.items()}
    agree(Assessment(**jax.jit(found)(one)), assess(task, one, max_length=8))
    assert expected.outside.keys() == {"x"}


@pytest.mark.parametrize("wrong", ["5", 1.5, -1, 0, True, jnp.asarray([3])])
def test_the_longest_length_is_a_whole_number(wrong: Any) -> None:
    with pytest.raises(UsageError, match="max_length is a number of steps, at least 1, or None; g"):
        assess(parse_task(RACE), GOOD, max_length=wrong)
    assert assess(parse_task(RACE), GOOD, max_length=np.int64(2)).length == 1  # type: ignore[arg-type]
