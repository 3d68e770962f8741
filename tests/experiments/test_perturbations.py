from __future__ import annotations

import numpy as np
import pytest

from hprs.carsim.designs import DESIGNS
from hprs.carsim.faults import FAULTS
from hprs.carsim.race import Settings
from hprs.carsim.randomisation import QUANTITIES, ranges
from hprs.errors import UsageError
from hprs.experiments import perturbations
from hprs.experiments.perturbations import (
    AS_TRAINED,
    GENERATED,
    NamedTrack,
    points,
    stacked,
    track_points,
    tracks_of_test,
)

NAMES = [quantity.name for quantity in QUANTITIES]


def test_every_quantity_and_every_fault_is_tested_inside_its_range_and_beyond():
    found = perturbations.perturbations()
    assert len(found) == len(QUANTITIES) + len(FAULTS)
    for quantity in QUANTITIES:
        assert list(quantity.tested) == sorted(set(quantity.tested))
        assert {quantity.low, quantity.high} <= set(quantity.tested)
        assert quantity.tested[-1] > quantity.high
        # What cannot be negative is not.
        assert quantity.tested[0] < quantity.low or quantity.low == quantity.tested[0] == 0


def test_a_quantity_is_tested_half_below_its_range_and_half_beyond_it():
    friction = perturbations.perturbations()["friction"]
    assert friction == pytest.approx((0.4, 0.6, 0.8, 0.95, 1.1, 1.375, 1.65))


def test_latency_is_tested_from_0_to_200_ms_at_every_simulation_step():
    assert perturbations.perturbations()["latency"] == tuple(float(10 * i) for i in range(21))
    found = points(Settings(), {"latency": (200.0,)})[-1]
    assert (found.perturbation, found.value, found.unit) == ("latency", "200", "ms")
    assert found.conditions.ranges.low[NAMES.index("delay")] == 20


def test_a_point_changes_one_quantity_and_leaves_the_ranges_of_the_others():
    usual, found = points(Settings(), {"mass": (6.0,)})
    row = NAMES.index("mass")
    for ends, before in zip(
        (found.conditions.ranges.low, found.conditions.ranges.high),
        (usual.conditions.ranges.low, usual.conditions.ranges.high),
        strict=True,
    ):
        assert ends[row] == 6.0
        assert np.array_equal(np.delete(ends, row), np.delete(before, row))


def test_values_of_the_training_are_marked():
    def trained(name, *values, within="all"):
        return [one.trained for one in points(Settings(ranges=ranges(within)), {name: values})[1:]]

    assert trained("friction", 0.7, 0.8, 1.0, 1.1, 1.2) == [False, True, True, True, False]
    assert trained("latency", 0, 50, 60) == [True, True, False]
    assert trained("friction", 0.8, 1.0489, 1.1, within="nominal") == [False, True, False]
    assert trained("speed_scale", 0.9, 1.0) == [False, True]


def test_the_first_point_changes_nothing():
    first = points(Settings(), {})
    assert [(one.perturbation, one.trained) for one in first] == [(AS_TRAINED, True)]
    assert np.array_equal(first[0].conditions.ranges.high, ranges().high)


@pytest.mark.parametrize(
    ("sweeps", "message"),
    [
        ({"frction": (1.0,)}, "no perturbation 'frction'. Did you mean 'friction'?"),
        ({"mass": (0.0,)}, "mass got [0, 0], but is above 0 on every car"),
        ({"latency": (400.0,)}, "at most 30 simulation steps are remembered"),
        ({"dropped_scans": (1.5,)}, "dropped_scans is a number from 0 to 1, got 1.5"),
    ],
)
def test_what_cannot_be_tested_is_one_clear_error(sweeps, message):
    with pytest.raises(UsageError) as caught:
        points(Settings(), sweeps)
    assert message in str(caught.value)


def test_points_are_stacked_for_one_program():
    found = stacked(points(Settings(), {"speed_offset": (-1.0, 1.0)}))
    assert found.ranges.low.shape == (3, len(QUANTITIES))
    assert found.faults.speed_offset.tolist() == [0, -1, 1]


def test_tracks_that_were_seen_are_marked():
    tracks = [NamedTrack(name, None) for name in ("gm", "gm backwards", "random:1000")]
    found = track_points(Settings(), tracks, ["gm"])
    assert [one.trained for one in found] == [True, False, False]
    assert stacked(found).track.tolist() == [0, 1, 2]


def test_no_generated_track_of_the_test_was_seen_whichever_way(monkeypatch):
    monkeypatch.setattr(perturbations, "load_track", lambda *_, **__: None)
    monkeypatch.setattr(perturbations, "random_track", lambda *_, **__: None)
    names = [each.name for each in tracks_of_test(["random:1000 backwards", "random:1002", "gm"])]
    assert len(names) == len(set(names)) == 2 * len(DESIGNS) + GENERATED
    assert not {"random:1000", "random:1002"} & {name.split()[0] for name in names}
    assert sum(name.startswith("random") for name in names) == GENERATED
    assert sum(name.endswith(" backwards") for name in names) == len(DESIGNS) + GENERATED // 2
