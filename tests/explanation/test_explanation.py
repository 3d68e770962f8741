"""What is said of an episode, against values worked by hand."""

import numpy as np
import pytest

from hprs import assess, parse_task
from hprs.errors import TraceError
from hprs.explanation import explanation
from hprs.explanation.explanation import explain, joined
from hprs.explanation.wording import judgement, number, percent, summary, verdict

TASK = parse_task(
    """
    signal wall in [-1, 4]
    signal lap in [0, 1]
    signal speed in [0, 4]
    encourage slow: speed <= 2
    ensure clear: wall >= 0
    achieve finish: lap >= 1
    """
)
TRACE = {
    "wall": np.array([1.0, 1.0, 1.0, -0.5]),
    "lap": np.array([0.0, 0.5, 1.0, 1.0]),
    "speed": np.array([0.0, 3.0, 2.0, 2.0]),
}


@pytest.fixture
def found():
    return explain(TASK, TRACE, title="by hand", rate=10.0)


def part(found, label):
    return next(one for one in found.parts if one.label == label)


def test_the_most_important_requirement_comes_first(found):
    assert [one.name for one in found.parts] == ["ensure clear", "achieve finish", "encourage slow"]


def test_every_requirement_has_its_numbers(found):
    slow = part(found, "slow")
    assert (slow.low, slow.high) == (-2.0, 2.0)
    assert slow.margins.tolist() == [2.0, -1.0, 0.0, 0.0]
    assert slow.scores.tolist() == [1.0, 0.5, 1.0, 1.0]
    assert slow.contributions.tolist() == [0.0, 0.25, 1.0, 0.0]
    assert slow.changes.tolist() == [0.0, 0.25, 0.75, -1.0]
    assert slow.satisfied.tolist() == [True, False, True, True]
    assert (slow.earned, slow.cost, slow.worst) == (1.0, -1.0, -1.0)
    assert slow.fraction == pytest.approx(2 / 3)


def test_contributions_add_up_to_potential_and_shaping(found):
    assert found.potential.tolist() == [1.0, 1.75, 3.0, 0.0]
    np.testing.assert_array_equal(sum(one.contributions for one in found.parts), found.potential)
    np.testing.assert_array_equal(sum(one.changes for one in found.parts), found.shaping)
    assert found.base.tolist() == [0.0, 0.0, 1.0, 1.0]


def test_the_assessment_is_that_of_the_trace(found):
    assert found.assessment == assess(TASK, TRACE)
    assert part(found, "slow").fraction == found.assessment.requirements["slow"]


def test_first_violations_are_of_safety_and_comfort(found):
    assert [one.first_violation for one in found.parts] == [3, None, 1]
    assert found.first_violation("safety") is part(found, "clear")
    assert found.first_violation("comfort") is part(found, "slow")
    assert found.first_violation("target") is None
    assert verdict(found, part(found, "clear")) == "violated at step 3 (0.30 s)"


@pytest.mark.parametrize(
    ("kind", "lap", "met"),
    [
        ("achieve", [0, 1, 0, 0], 1),
        ("achieve", [0, 0, 0, 0], None),
        ("conquer", [0, 1, 0, 0], None),
        ("conquer", [1, 0, 1, 1], 2),
        ("conquer", [1, 1, 1, 1], 0),
    ],
)
def test_a_target_counts_as_met_from_a_step_on(kind, lap, met):
    task = parse_task(f"signal lap in [0, 1]\n{kind} finish: lap >= 1")
    [only] = explain(task, {"lap": lap}).parts
    assert only.met_from == met
    assert only.first_violation is None


def test_the_words_say_the_numbers(found):
    assert summary(found) == (
        f"3 steps (0.30 s), PAM {found.assessment.pam:.3f}: not safe, on target, comfort 0.667"
    )
    assert judgement(part(found, "slow")) == "earned +1.000, cost \N{MINUS SIGN}1.000, held 66.7%"
    assert verdict(found, part(found, "finish")) == "met from step 2 (0.20 s)"
    assert [number(value).replace("\N{MINUS SIGN}", "-") for value in (0.0, -0.5, 1e-5, 4e6)] == [
        "0.000", "-0.500", "1e-05", "4e+06",
    ]  # fmt: skip
    assert [percent(value) for value in (0, 1e-6, 0.5, 1 - 1e-6, 1)] == [
        "0.0%", "<0.1%", "50.0%", ">99.9%", "100.0%",
    ]  # fmt: skip


def test_without_a_target_there_is_no_base_reward():
    task = parse_task("signal wall in [-1, 4]\nensure clear: wall >= 0")
    found = explain(task, {"wall": [1, 1]})
    assert found.base.tolist() == [0.0, 0.0]
    assert found.moment(1) == "step 1"


def test_what_cannot_be_explained_is_one_line(monkeypatch):
    batch = {name: np.stack([values, values], axis=-1) for name, values in TRACE.items()}
    with pytest.raises(TraceError, match="a batch of episodes cannot be explained"):
        explain(TASK, batch)
    with pytest.raises(TraceError, match="needs the initial state and at least one step"):
        explain(TASK, {name: values[:1] for name, values in TRACE.items()})
    monkeypatch.setattr(explanation, "LONGEST", 3)
    with pytest.raises(TraceError, match="an episode of 4 states is too long to explain"):
        explain(TASK, TRACE)
    with pytest.raises(TraceError, match="an episode of more than 3 states is too long"):
        joined([TRACE])


def test_a_trace_in_pieces_is_joined():
    pieces = [
        {name: values[part] for name, values in TRACE.items()} for part in (slice(2), slice(2, 4))
    ]
    for name, values in joined(pieces).items():
        np.testing.assert_array_equal(values, TRACE[name])


def test_a_margin_that_is_no_number_is_named():
    task = parse_task("signal x in [0, 1]\nensure fine: sqrt(x) >= 0.1")
    with pytest.raises(TraceError, match="margin of requirement 'fine' is NaN at step 1"):
        explain(task, {"x": [0.5, -1.0]})
