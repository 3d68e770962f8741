"""The built-in tracks are the paper's in length and can be driven as its task asks."""

from __future__ import annotations

import numpy as np
import pytest

from hprs.carsim.designs import DESIGNS, load_track
from hprs.carsim.geometry import curvature, point_distances, resample
from hprs.errors import UsageError
from tests.carsim.tracks import track_of, walls_of

PAPER = {"gm": 21.25, "trt": 51.65, "gm-c": 13.50}
each_design = pytest.mark.parametrize("name", DESIGNS)


def test_there_are_the_three_tracks_of_the_paper():
    assert DESIGNS.keys() == PAPER.keys()


@each_design
def test_the_centre_line_has_the_length_of_the_paper(name):
    points = np.asarray(track_of(name).centre, float)
    steps = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
    assert float(track_of(name).length) == pytest.approx(PAPER[name], abs=0.01)
    assert steps.sum() == pytest.approx(PAPER[name], abs=0.01)
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.01)


@each_design
def test_the_corridor_is_as_wide_as_the_real_one(name):
    width = np.asarray(track_of(name).left + track_of(name).right)
    assert width.min() >= 1.0
    assert width.max() <= 2.3


@each_design
def test_the_car_can_turn_as_the_centre_line_does(name):
    (coarse,) = resample(np.asarray(track_of(name).centre, float), 256)
    assert 1 / np.abs(curvature(coarse)).max() >= 1.4


@each_design
def test_keeping_to_the_centre_line_meets_the_requirement_of_the_task(name):
    track = track_of(name)
    gaps = point_distances(np.asarray(track.centre, float), walls_of(name)).min(axis=1)
    # The worst place, in the S of trt, has 0.512.
    assert (gaps / float(track.max_clearance)).min() >= 0.5


@each_design
def test_the_lap_starts_in_the_origin_along_the_x_axis(name):
    points = np.asarray(track_of(name).centre)
    np.testing.assert_allclose(points[0], 0, atol=1e-6)
    assert points[1, 0] > 0
    assert abs(points[1, 1]) < 1e-3


def test_backwards_the_walls_change_sides():
    forwards, backwards = track_of("trt"), track_of("trt backwards")
    np.testing.assert_allclose(backwards.centre[1:], forwards.centre[:0:-1], atol=1e-6)
    np.testing.assert_allclose(backwards.left[1:], forwards.right[:0:-1], atol=1e-5)


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(UsageError, match=r"No track is called 'gmc'\. Did you mean 'gm-c'\?"):
        load_track("gmc")
