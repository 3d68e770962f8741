"""What plots draw: everything of a short episode, and no spike less of a long one."""

import numpy as np
import pytest

from hprs import parse_task
from hprs.explanation.explanation import explain
from hprs.explanation.outline import FINE, STRETCHES, Axis, axis, outline

TASK = parse_task("signal x in [-1, 4]\nsignal free in [-inf, inf]\nensure clear: x >= 0\nensure any: free <= 1")  # fmt: skip


def episode(x):
    x = np.asarray(x, float)
    return explain(TASK, {"x": x, "free": np.zeros(len(x))})


def test_a_short_episode_is_drawn_whole():
    found = episode([1, -0.5, -0.5, 2, -0.5])
    drawn = outline(found)
    assert drawn.is_exact
    assert drawn.stops.tolist() == [0, 1, 2, 3, 4]
    assert drawn.violated(found.parts[0]) == [(1, 2), (4, 4)]
    assert drawn.violated(found.parts[1]) == []


def test_a_long_episode_keeps_its_spikes():
    x = np.ones(FINE * 50)
    x[777], x[51_234] = -0.25, -0.75
    found = episode(x)
    drawn = outline(found)
    assert not drawn.is_exact
    assert len(drawn.starts) <= STRETCHES
    assert len(drawn.stops) <= 3 * STRETCHES + 10
    assert {0, 777, 51_234, len(x) - 1} <= set(drawn.stops.tolist())
    clear = found.parts[0]
    assert drawn.least(clear.margins).min() == -0.75
    assert drawn.greatest(clear.margins).min() == 1.0
    low, high = zip(*drawn.violated(clear), strict=True)
    assert [low[i] <= step <= high[i] for i, step in enumerate((777, 51_234))] == [True, True]
    assert drawn.ends[-1] == len(x) - 1


def test_each_half_of_an_axis_has_its_scale():
    scale = Axis(-1.0, 4.0)
    assert scale.place(np.array([-1.0, -0.5, 0.0, 2.0, 4.0])).tolist() == [0, 0.25, 0.5, 0.75, 1]


@pytest.mark.parametrize(
    ("x", "expected"),
    [([0, 1], (-1, 4)), ([-3, 1], (-3, 4)), ([0, 9], (-1, 9))],
)
def test_margins_beyond_their_bounds_stretch_the_axis(x, expected):
    scale = axis(episode(x).parts[0])
    assert (scale.bottom, scale.top) == expected


def test_an_axis_without_bounds_takes_the_margins():
    scale = axis(episode([0, 1]).parts[1])
    assert (scale.bottom, scale.top) == (-1.0, 1.0)
