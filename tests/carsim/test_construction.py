"""A track is refused where it cannot be driven, and where progress would not be an arc length."""

from __future__ import annotations

import numpy as np
import pytest

from hprs.carsim.construction import LONGEST, construct_track, turns_around, walls_beside
from hprs.carsim.track import POINTS
from hprs.errors import TrackError


def circle(radius, *, number=400, turns=1):
    angle = np.linspace(0, 2 * np.pi * turns, number, endpoint=False)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def test_the_points_of_the_longest_track_are_a_metre_apart():
    assert LONGEST / POINTS < 1
    # In the tightest bend of the built-in tracks a chord is that much shorter than its arc.
    angle = LONGEST / POINTS / 1.4
    assert 1 - np.sin(angle / 2) / (angle / 2) < 0.03


@pytest.mark.parametrize("length", [4.9, 1001.0])
def test_a_lap_of_absurd_length_is_refused(length):
    centre = circle(length / (2 * np.pi))
    with pytest.raises(TrackError, match=r"m long, which is not within 5 m and 1000 m"):
        construct_track(centre, [centre], name="ring")


@pytest.mark.parametrize("turns", [-1, 0, 1, 2])
def test_turns_are_counted(turns):
    line = circle(2.0, turns=turns) if turns else circle(2.0) + np.array([3.0, 0.0])
    assert turns_around(line, np.zeros(2)) == turns


def test_a_lap_goes_round_the_given_wall_once_in_any_direction():
    centre, half = circle(2.0, number=40), np.full(40, 0.7)
    loops = walls_beside(centre, half, half, name="ring")
    for reverse in (False, True):
        construct_track(centre, loops, name="ring", around=loops[0], reverse=reverse)
    beside = 0.1 * circle(2.0) + np.array([2.0, 0.6])
    with pytest.raises(TrackError, match=r"ring: its centre line is no lap: near \(2\.\d+, "):
        construct_track(centre, loops, name="ring", around=beside)
