import pytest

from hprs.envs import task_of
from hprs.semantics.assessment import Assessment
from hprs.training.intervals import wilson
from hprs.training.measures import measures, outside_ranges

TASK = task_of("hprs/CartPole-v0")


def assessment(pam, *, safe, target, slow, outside=None):
    return Assessment(
        pam=pam,
        safe=safe,
        target=target,
        comfort=slow,
        requirements={
            "on_track": True,
            "pole_up": safe,
            "parked": target,
            "upright": slow,
            "slow": slow,
        },
        length=10,
        decided_at_start=False,
        outside=outside or {},
    )


FOUND = [
    assessment(1.5 + 0.25 * 0.8, safe=True, target=True, slow=0.8, outside={"v": 2}),
    assessment(1.0 + 0.25 * 0.4, safe=True, target=False, slow=0.4, outside={"v": 1, "x": 5}),
    assessment(0.5, safe=False, target=True, slow=0.0),
    assessment(0.0, safe=False, target=False, slow=0.0),
]


def test_measures_are_the_papers_columns_and_every_requirement():
    found = measures(TASK, FOUND)
    assert list(found) == [
        "S", "S+T", "S+T+C", "PAM",
        "ensure on_track", "ensure pole_up", "conquer parked", "encourage upright", "encourage slow",
    ]  # fmt: skip
    values = {name: measure.value for name, measure in found.items()}
    assert values["S"] == 0.5
    assert values["S+T"] == 0.25
    assert values["S+T+C"] == pytest.approx(0.2)
    assert values["PAM"] == pytest.approx((1.7 + 1.1 + 0.5) / 4)
    assert values["conquer parked"] == 0.5
    assert values["encourage slow"] == pytest.approx(0.3)


def test_fractions_of_episodes_get_wilsons_interval():
    found = measures(TASK, FOUND)
    assert (found["S+T"].low, found["S+T"].high) == wilson(1, 4)
    assert (found["ensure on_track"].low, found["ensure on_track"].high) == wilson(4, 4)


def test_every_interval_contains_its_value():
    for measure in measures(TASK, FOUND).values():
        assert measure.low <= measure.value <= measure.high


def test_states_outside_their_range_are_added_up():
    assert outside_ranges(FOUND) == {"v": 3, "x": 5}
