"""A bundle computes what was written into it, and says when it cannot."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hprs.deploy import BoxLayout, ChoiceLayout, Layer, ObservationLayout
from hprs.deploy.archive import from_bytes, to_bytes
from hprs.errors import BundleError
from tests.deploy.small import box, checked, forged, numbers, small

IDENTITY = Layer(numbers([1, 0], [0, 1]), numbers(0, 0))
CHECKS = {"check_observations": numbers([1, 2]), "check_actions": numbers([1, 2])}


def test_a_relu_network_worked_by_hand():
    # Hidden: max(0, 0.25), max(0, 2 * 0.75 - 1); outputs 0.25 + 0.5 and 0.5, to [-2, 2] and [0, 1].
    np.testing.assert_allclose(small()(numbers(0.25, 0.75)), [1.5, 0.75], rtol=1e-6)
    # Below 0 nothing comes through.
    np.testing.assert_allclose(small()(numbers(-1, 0)), [1.0, 0.5], rtol=1e-6)


def test_a_tanh_network_worked_by_hand():
    bundle = small(activation="tanh", action=box(mapping="raw", low=(-9, -9), high=(9, 9)))
    wanted = [np.tanh(0.25) + 0.5, np.tanh(0.5)]
    np.testing.assert_allclose(bundle(numbers(0.25, 0.75)), wanted, rtol=1e-6)


def test_choices_are_counted_from_the_first():
    bundle = small(action=ChoiceLayout(2, start=3))
    assert bundle.batch(numbers([1, 0], [0, 2])).tolist() == [3, 4]
    assert bundle(numbers(1, 0)) == 3


def test_an_action_has_the_shape_of_the_space():
    layout = BoxLayout((1, 2), numbers(-1, -1), numbers(1, 1))
    assert small(action=layout).batch(np.zeros((5, 2))).shape == (5, 1, 2)


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(1, 5))
def test_batches_rows_and_plain_numpy_agree(seed, inputs, rows):
    rng = np.random.default_rng(seed)
    first, last = rng.normal(size=(inputs, 3)), rng.normal(size=(3, 2))
    bundle = small(
        layers=(
            Layer(first.astype(np.float32), numbers(0, 0, 1)),
            Layer(last.astype(np.float32), numbers(0, 0)),
        ),
        observation=ObservationLayout((inputs,)),
        activation="tanh",
    )
    seen = rng.normal(size=(rows, inputs)).astype(np.float32)
    outputs = np.tanh(seen @ first + [0, 0, 1]) @ last
    wanted = np.clip(outputs, -1, 1) * [2, 0.5] + [0, 0.5]
    np.testing.assert_allclose(bundle.batch(seen), wanted, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(bundle.batch(seen), [bundle(one) for one in seen], atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"activation": "sine"}, "activation is one of tanh, relu, not 'sine'"),
        ({"layers": ()}, "the network has no layers"),
        (
            {"observation": ObservationLayout((3,))},
            "layer 0 has weights of shape (2, 2), but is given 3 numbers",
        ),
        (
            {"layers": (IDENTITY, Layer(numbers([1, 0]), numbers(0, 0)))},
            "layer 1 has weights of shape (1, 2), but is given 2 numbers",
        ),
        (
            {"layers": (Layer(numbers(1, 0), numbers(0)),)},
            "layer 0 has weights of shape (2,), but is given 2 numbers",
        ),
        ({"action": ChoiceLayout(5)}, "the network has 2 outputs, the action needs 5"),
        (
            {"layers": (Layer(numbers([1, 0], [0, 1]), numbers(0)),)},
            "the bias of layer 0 has shape (1,), not (2,)",
        ),
        (
            {"layers": (IDENTITY, Layer(IDENTITY.weights, numbers(0, np.inf)))},
            "the bias of layer 1 holds NaN or infinity",
        ),
        (
            {"layers": (Layer(IDENTITY.weights.astype(complex), IDENTITY.bias),)},
            "the weights of layer 0 holds complex128, not numbers",
        ),
        (
            {**CHECKS, "check_observations": numbers([1, 2, 3])},
            "check_observations has shape (1, 3), not (1, 2)",
        ),
        (
            {**CHECKS, "check_actions": numbers([1], [2])},
            "check_actions has shape (2, 1), not (1, 2)",
        ),
    ],
)
def test_parts_that_do_not_fit_are_named(changes, message):
    with pytest.raises(BundleError) as error:
        small(**changes)
    assert message in str(error.value)


def test_observations_that_cannot_be_meant_are_refused():
    with pytest.raises(BundleError, match=r"observations of shape \(2,\), not \(3,\)"):
        small()(numbers(1, 2, 3))
    with pytest.raises(BundleError, match="Component 1 of observation 0 is nan"):
        small()(numbers(0, np.nan))


def test_a_self_check_notices_other_weights():
    bundle = checked()
    bundle.self_check()
    first, last = bundle.layers
    other = replace(bundle, layers=(first, Layer(last.weights * 1.01, last.bias)))
    with pytest.raises(BundleError, match="self-check failed: in observation 1"):
        from_bytes(to_bytes(other)).self_check()


def test_weights_edited_in_the_file_are_noticed_though_the_digest_fits():
    bundle = checked()
    edited = forged(bundle, arrays={"weights-1": bundle.layers[1].weights * 1.01})
    with pytest.raises(BundleError, match="self-check failed"):
        from_bytes(edited).self_check()


@pytest.mark.parametrize("missing", ["check-observations", "check-actions"])
def test_without_checks_a_self_check_fails(missing):
    found = from_bytes(forged(checked(), arrays={missing: None}))
    with pytest.raises(BundleError, match="holds nothing to check itself with"):
        found.self_check()
    none = {"check_observations": np.zeros((0, 2)), "check_actions": np.zeros((0, 2))}
    with pytest.raises(BundleError, match="no observations to check itself with"):
        small(**none).self_check()


def test_an_expected_action_of_nan_is_never_met():
    bundle = checked()
    expected = bundle.check_actions.copy()
    expected[2, 0] = np.nan
    with pytest.raises(BundleError, match="in observation 2 the action is"):
        replace(bundle, check_actions=expected).self_check()
