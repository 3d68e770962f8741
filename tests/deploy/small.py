"""A small bundle, and its file taken apart and forged."""

import io
import json
import zipfile
from dataclasses import replace

import numpy as np

from hprs.deploy import BoxLayout, Bundle, Layer, ObservationLayout
from hprs.deploy.archive import _array, _digest, _npy, to_bytes


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


def archive(**files):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as made:
        for name, data in files.items():
            made.writestr(name, data)
    return stream.getvalue()


def parts(data):
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def forged(bundle, content=(), arrays=()):
    """A file with other content or arrays (None: without) and the digest that fits them."""
    files = parts(to_bytes(bundle))
    made = {**json.loads(files.pop("bundle.json")), **dict(content)}
    del made["sha256"]
    held = {name[:-4]: _array(data) for name, data in files.items()}
    held = {name: array for name, array in {**held, **dict(arrays)}.items() if array is not None}
    made["sha256"] = _digest(made, held)
    files = {f"{name}.npy": _npy(array) for name, array in held.items()}
    return archive(**{"bundle.json": json.dumps(made), **files})
