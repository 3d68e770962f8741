"""A bundle computes what was written into it, says when it cannot, and notices every change."""

import ast
import io
import json
import pickle
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hprs
from hprs.deploy import (
    BoxLayout,
    Bundle,
    ChoiceLayout,
    Layer,
    ObservationLayout,
    load_bundle,
    save_bundle,
)
from hprs.deploy.archive import from_bytes, to_bytes
from hprs.errors import BundleError

INFINITE = float("inf")


def numbers(*values):
    return np.array(values, np.float32)


def box(*, mapping="clip", low=(-2.0, 0.0), high=(2.0, 1.0)):
    return BoxLayout((2,), numbers(*low), numbers(*high), mapping)


def small(**changes):
    """Two inputs, two hidden units, two outputs."""
    parts = {
        "layers": (
            Layer(numbers([1, 0], [0, 2]), numbers(0, -1)),
            Layer(numbers([1, 0], [0, 1]), numbers(0.5, 0)),
        ),
        "observation": ObservationLayout((2,)),
        "action": box(),
        "activation": "relu",
        "task": {"text": "ensure"},
        "rate": 10.0,
        "provenance": {"run": "x"},
    }
    return Bundle(**{**parts, **changes})


def checked(bundle=None):
    bundle = bundle or small()
    seen = numbers([0, 0], [0.25, 0.75], [-1, 0.5])
    return replace(bundle, check_observations=seen, check_actions=bundle.batch(seen))


def test_a_relu_network_worked_by_hand():
    # Hidden: max(0, 0.25), max(0, 2 * 0.75 - 1); outputs 0.25 + 0.5 and 0.5, to [-2, 2] and [0, 1].
    np.testing.assert_allclose(small()(numbers(0.25, 0.75)), [1.5, 0.75], rtol=1e-6)
    # Below 0 nothing comes through.
    np.testing.assert_allclose(small()(numbers(-1, 0)), [1.0, 0.5], rtol=1e-6)


def test_a_tanh_network_worked_by_hand():
    bundle = small(activation="tanh", action=box(mapping="raw", low=(-9, -9), high=(9, 9)))
    wanted = [np.tanh(0.25) + 0.5, np.tanh(0.5)]
    np.testing.assert_allclose(bundle(numbers(0.25, 0.75)), wanted, rtol=1e-6)


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


def test_a_file_brings_everything_back(tmp_path):
    layout = ObservationLayout((2,), numbers(1, 0), numbers(2, 0.5), 5.0, {"unit": "m"})
    bundle, file = checked(small(observation=layout)), tmp_path / "p.bundle"
    save_bundle(bundle, file)
    found = load_bundle(file)
    assert to_bytes(found) == to_bytes(bundle) == file.read_bytes()
    assert (found.task, found.rate, found.provenance) == (bundle.task, 10.0, {"run": "x"})
    assert found.observation.details == {"unit": "m"}
    found.self_check()
    choice = small(action=ChoiceLayout(2, start=1))
    assert from_bytes(to_bytes(choice)).action.start == 1


def test_every_changed_byte_is_noticed_or_harmless():
    data, bundle = to_bytes(checked()), checked()
    noticed = 0
    for place in range(0, len(data), 7):
        changed = bytearray(data)
        changed[place] ^= 0x10
        try:
            found = from_bytes(bytes(changed))
        except BundleError:
            noticed += 1
            continue
        # Fields of the archive that nobody reads, as the time of an entry.
        np.testing.assert_array_equal(found.batch(bundle.check_observations), bundle.check_actions)
        assert found.task == bundle.task
    assert noticed > len(data) / 7 / 2


def archive(**files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as made:
        for name, data in files.items():
            made.writestr(name, data)
    return stream.getvalue()


def parts(data):
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def test_nothing_is_unpickled(monkeypatch):
    def never(*arguments, **options):
        raise AssertionError("unpickled")

    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.array([print], dtype=object), allow_pickle=True)
    monkeypatch.setattr(pickle, "load", never)
    monkeypatch.setattr(pickle, "loads", never)
    files = parts(to_bytes(small()))
    for evil in (stream.getvalue(), pickle.dumps(print)):
        with pytest.raises(BundleError, match="damaged, or no bundle"):
            from_bytes(archive(**{**files, "mean.npy": evil}))


def test_another_format_is_named():
    files = parts(to_bytes(small()))
    content = {**json.loads(files["bundle.json"]), "format": 7}
    with pytest.raises(BundleError, match="format is 7; this hprs reads format 1"):
        from_bytes(archive(**{**files, "bundle.json": json.dumps(content)}))


@pytest.mark.parametrize("data", [b"", b"no zip", archive(a="b"), archive(**{"bundle.json": "[]"})])
def test_what_is_no_bundle_is_said_so(data, tmp_path):
    file = tmp_path / "p.bundle"
    file.write_bytes(data)
    with pytest.raises(BundleError) as error:
        load_bundle(file)
    assert str(file) in str(error.value)


def test_a_missing_file_is_said_so(tmp_path):
    with pytest.raises(BundleError, match=r"none\.bundle cannot be read: No such file"):
        load_bundle(tmp_path / "none.bundle")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"activation": "sine"}, "activation is one of tanh, relu, not 'sine'"),
        ({"action": box(mapping="wrap")}, "mapping is one of clip, tanh, raw"),
        ({"observation": ObservationLayout((3,))}, "layer 0 takes (2,) numbers, but is given 3"),
        ({"action": ChoiceLayout(5)}, "the network has 2 outputs, the action needs 5"),
        (
            {"layers": (Layer(numbers([1, 0], [0, 1]), numbers(0)),)},
            "the bias of layer 0 has shape (1,), not (2,)",
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
    with pytest.raises(BundleError, match="Component 1 of observation 0 is NaN"):
        small()(numbers(0, np.nan))


def test_a_self_check_notices_other_weights():
    bundle = checked()
    bundle.self_check()
    first, last = bundle.layers
    other = replace(bundle, layers=(first, Layer(last.weights * 1.01, last.bias)))
    with pytest.raises(BundleError, match="self-check failed: in observation 1"):
        from_bytes(to_bytes(other)).self_check()
    with pytest.raises(BundleError, match="holds nothing to check itself with"):
        small().self_check()


def test_numpy_is_all_it_imports():
    code = """
import sys
import hprs
hprs.deploy.load_bundle
foreign = {name.partition(".")[0] for name in sys.modules}
print(sorted(foreign & {"gymnasium", "jax", "torch", "lark", "rich", "tyro", "scipy"}))
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "[]\n"


@pytest.mark.parametrize(
    "file",
    [*Path(hprs.__file__).parent.glob("deploy/*.py"), Path(hprs.__file__).parent / "errors.py"],
    ids=lambda file: file.name,
)
def test_its_syntax_is_that_of_python_3_8(file):
    ast.parse(file.read_text(), feature_version=(3, 8))
