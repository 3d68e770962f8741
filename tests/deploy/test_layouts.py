"""Observations enter a network, and its outputs become actions, as worked out by hand."""

import numpy as np
import pytest

from hprs.deploy import BoxLayout, ChoiceLayout, ObservationLayout
from hprs.errors import BundleError
from tests.deploy.small import box, numbers

INFINITE = float("inf")


def test_observations_are_centred_scaled_and_clipped():
    layout = ObservationLayout((2,), numbers(1, 0), numbers(2, 0.5), clip=1.5)
    np.testing.assert_allclose(layout.rows([[3, 0.25], [9, -9]]), [[1, 0.5], [1.5, -1.5]])


@pytest.mark.parametrize(
    ("mapping", "outputs", "wanted"),
    [
        ("clip", [0.5, 0.5], [1.0, 0.75]),
        ("clip", [3.0, -3.0], [2.0, 0.0]),
        ("tanh", [0.5, -20.0], [2 * np.tanh(0.5), 0.0]),
        ("raw", [1.5, 5.0], [1.5, 1.0]),
    ],
)
def test_outputs_become_actions(mapping, outputs, wanted):
    np.testing.assert_allclose(box(mapping=mapping).actions(numbers(outputs))[0], wanted, rtol=1e-6)


@pytest.mark.parametrize("mapping", ["clip", "tanh", "raw"])
def test_what_has_no_two_bounds_is_taken_as_it_is(mapping):
    layout = box(mapping=mapping, low=(-INFINITE, 0), high=(INFINITE, INFINITE))
    np.testing.assert_allclose(layout.actions(numbers([7, 7], [-7, -7])), [[7, 7], [-7, 0]])


def test_one_bound_clips_and_does_not_scale():
    layout = box(low=(-INFINITE, 1), high=(3, INFINITE))
    np.testing.assert_allclose(layout.actions(numbers([7, 7], [-7, -7])), [[3, 7], [-7, 1]])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mean": numbers(1)}, "mean has shape (1,), not (2,)"),
        ({"deviation": numbers(1, 2, 3)}, "deviation has shape (3,), not (2,)"),
        ({"deviation": None}, "mean and deviation come together, but one of them is missing"),
        ({"deviation": numbers(1, 0)}, "deviation must be positive, got [1. 0.]"),
        ({"deviation": numbers(1, np.nan)}, "deviation must be positive, got [ 1. nan]"),
        ({"mean": np.array(["a", "b"])}, "mean holds <U1, not numbers"),
        ({"clip": 0.0}, "clip must be positive, got 0.0"),
    ],
)
def test_what_cannot_normalise_is_named(changes, message):
    parts = {"shape": (2,), "mean": numbers(0, 0), "deviation": numbers(1, 1)}
    with pytest.raises(BundleError) as error:
        ObservationLayout(**{**parts, **changes})
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mapping": "wrap"}, "mapping is one of clip, tanh, raw, not 'wrap'"),
        ({"low": numbers(0)}, "low has shape (1,), not (2,)"),
        ({"high": numbers(0, 0, 0)}, "high has shape (3,), not (2,)"),
        ({"low": numbers(0, 2)}, "low [0. 2.] must not be above high [1. 1.]"),
        ({"high": numbers(0, np.nan)}, "must not be above high"),
    ],
)
def test_bounds_that_do_not_fit_are_named(changes, message):
    parts = {"shape": (2,), "low": numbers(0, 0), "high": numbers(1, 1)}
    with pytest.raises(BundleError) as error:
        BoxLayout(**{**parts, **changes})
    assert message in str(error.value)


def test_no_choice_is_no_action():
    with pytest.raises(BundleError, match="at least one output, got 0"):
        ChoiceLayout(0)


def test_observations_of_another_shape_are_refused():
    layout = ObservationLayout((2,))
    with pytest.raises(BundleError, match=r"observations of shape \(2,\), not \(3,\)"):
        layout.rows(numbers([1, 2, 3]))
    with pytest.raises(BundleError, match=r"observations of shape \(2,\)"):
        layout.rows(1.0)


def test_nan_is_never_let_in_and_infinity_only_where_it_is_clipped():
    plain = ObservationLayout((2,))
    normalising = ObservationLayout((2,), numbers(0, 0), numbers(1, 1))
    for layout in (plain, normalising):
        with pytest.raises(BundleError, match="Component 1 of observation 0 is nan"):
            layout.rows([[0, np.nan]])
    with pytest.raises(BundleError, match="Component 0 of observation 1 is -inf"):
        plain.rows([[0, 0], [-INFINITE, 0]])
    np.testing.assert_array_equal(normalising.rows([[-INFINITE, INFINITE]]), [[-10, 10]])
