"""One table of operations for Python floats and for the arrays of every library."""

from __future__ import annotations

import itertools
import math
from typing import Any

import array_api_compat.torch as torch_xp
import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs.spec.namespace import (
    array_operations,
    as_floating,
    both,
    either,
    float_operations,
    namespace_of,
    select,
)

VALUES = (-math.inf, -1e200, -3.0, -0.5, 0.0, 0.5, 1.0, 3.0, 710.0, 1e200, math.inf, math.nan)
ONE = ("abs", "sqrt", "exp", "log", "sin", "cos", "tan", "sign")
TWO = ("/", "**", "min", "max", "atan2", "hypot")


def test_floats_and_numpy_know_the_same_operations() -> None:
    assert float_operations().keys() == array_operations(np).keys()


@pytest.mark.parametrize("name", ONE)
def test_floats_give_numpys_answers_where_python_would_raise(name: str) -> None:
    for x in VALUES:
        with np.errstate(all="ignore"):
            expected = array_operations(np)[name](np.asarray(x))
        found = float_operations()[name](x)
        assert type(found) is float
        np.testing.assert_allclose(found, expected, rtol=1e-12, err_msg=f"{name}({x})")


@pytest.mark.parametrize("name", TWO)
def test_floats_of_two_arguments_give_numpys_answers(name: str) -> None:
    for a, b in itertools.product(VALUES, VALUES):
        if name == "**" and a == -math.inf and b == 0.5:
            continue  # Python says inf, and NumPy nan, by way of its square root.
        with np.errstate(all="ignore"):
            expected = array_operations(np)[name](np.asarray(a), np.asarray(b))
        found = float_operations()[name](a, b)
        assert type(found) is float
        np.testing.assert_allclose(found, expected, rtol=1e-12, err_msg=f"{name}({a}, {b})")


def test_extrema_and_clip_of_several_floats_let_nan_through() -> None:
    operations = float_operations()
    assert operations["min"](3.0, 1.0, 2.0) == 1.0
    assert operations["max"](1.0, 3.0, 2.0) == 3.0
    assert operations["clip"](5.0, 0.0, 1.0) == 1.0
    # The upper end wins where the ends are crossed, as min(max(x, low), high) does.
    assert operations["clip"](5.0, 2.0, 1.0) == 1.0
    for name in ("min", "max", "clip"):
        for position in range(3):
            arguments = [1.0, 2.0, 3.0]
            arguments[position] = math.nan
            assert math.isnan(operations[name](*arguments))
    assert operations["min"](*map(float, range(5000, 0, -1))) == 1.0
    assert operations["max"](*map(float, range(5000))) == 4999.0


@pytest.mark.parametrize("name", ["min", "max", "sum", "mean", "norm"])
def test_reductions_act_on_the_last_axis(name: str) -> None:
    x = np.random.default_rng(0).normal(size=(2, 3))
    expected = array_operations(np)[f"reduce {name}"](x)
    assert expected.shape == (2,)
    for row, value in zip(x, expected, strict=True):
        found = float_operations()[f"reduce {name}"](row)
        assert type(found) is float
        assert found == pytest.approx(value)
    by_torch = array_operations(torch_xp)[f"reduce {name}"](torch.asarray(x))
    np.testing.assert_allclose(by_torch, expected)


@pytest.mark.parametrize("name", ["min", "max", "atan2", "hypot"])
def test_numbers_and_arrays_mix_on_either_side(name: str) -> None:
    x = [-1.0, 0.5, 2.0]
    reference = array_operations(np)[name]
    for array in (torch.asarray(x, dtype=torch.float64), jnp.asarray(x)):
        operation = array_operations(namespace_of([array]))[name]
        np.testing.assert_allclose(operation(array, 0.1), reference(np.asarray(x), 0.1), rtol=1e-6)
        np.testing.assert_allclose(operation(0.1, array), reference(0.1, np.asarray(x)), rtol=1e-6)


def test_two_numbers_before_an_array_keep_their_precision() -> None:
    x = torch.asarray([5.0], dtype=torch.float64)
    assert array_operations(torch_xp)["clip"](0.1, 0.0, x).item() == 0.1
    assert array_operations(torch_xp)["min"](0.1, 0.2, x).item() == 0.1


def test_the_namespace_is_that_of_the_arrays() -> None:
    assert namespace_of([]) is np
    assert namespace_of([1.0, True, [1.0], np.float32(1.0), np.zeros(2)]) is np
    assert namespace_of([1.0, np.zeros(2), torch.zeros(2)]) is torch_xp
    assert namespace_of([jnp.zeros(2), 1.0]).asarray(1.0).dtype == jnp.float32
    with pytest.raises(TypeError):
        namespace_of([jnp.zeros(2), torch.zeros(2)])
    with pytest.raises(TypeError):
        namespace_of(["text"])


@pytest.mark.parametrize(
    ("value", "xp", "dtype"),
    [
        (1, np, "float64"),
        (True, np, "float64"),
        ([1, 2], np, "float64"),
        (np.float32(1), np, "float32"),
        (np.asarray([True]), np, "float64"),
        (torch.asarray([1, 2]), torch_xp, "float32"),
        (torch.asarray([True]), torch_xp, "float32"),
        (torch.zeros(2, dtype=torch.float64), torch_xp, "float64"),
        (torch.zeros(2, dtype=torch.float16), torch_xp, "float16"),
        (np.zeros(2), torch_xp, "float64"),
        (2, torch_xp, "float32"),
    ],
)
def test_whole_numbers_and_truth_values_become_floating(value: Any, xp: Any, dtype: str) -> None:
    found = as_floating(value, xp)
    assert str(found.dtype).endswith(dtype)
    np.testing.assert_array_equal(np.asarray(found, float), np.asarray(value, float))


def test_floating_arrays_pass_as_they_are() -> None:
    for array, xp in ((np.zeros(2), np), (torch.zeros(2), torch_xp)):
        assert as_floating(array, xp) is array


def test_selecting_by_a_truth_value_or_by_an_array() -> None:
    assert select(True, 1.0, 2.0) == 1.0
    assert select(False, 1.0, 2.0) == 2.0
    assert select(np.True_, 1.0, 2.0) == 1.0
    assert select(np.asarray([True, False]), 1.0, np.zeros(2)).tolist() == [1.0, 0.0]
    assert select(torch.asarray([True, False]), torch.ones(2), 0.0).tolist() == [1.0, 0.0]


def test_truth_values() -> None:
    assert both(True, False) is False
    assert either(True, False) is True
    assert both(np.asarray([True, False]), True).tolist() == [True, False]
