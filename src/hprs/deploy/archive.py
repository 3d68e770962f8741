"""A bundle as one file: a zip archive of JSON and NumPy arrays, of which nothing is executed."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from pathlib import Path
from typing import Any, Dict, Mapping, Tuple, Union

import numpy as np

from hprs.deploy.bundle import Bundle, Layer
from hprs.deploy.layouts import ActionLayout, BoxLayout, ChoiceLayout, ObservationLayout
from hprs.errors import BundleError

FORMAT = 1
_CONTENT = "bundle.json"
_DAMAGES = (
    zipfile.BadZipFile,
    EOFError,
    KeyError,
    MemoryError,
    OSError,
    OverflowError,
    RuntimeError,
    ValueError,
)
_LONG_AGO = (1980, 1, 1, 0, 0, 0)
"""The time of every entry: equal bundles have equal bytes."""


def save_bundle(bundle: Bundle, path: Union[str, Path]) -> None:
    """Write a bundle into a file.

    Raises:
        BundleError: The file cannot be written.
    """
    data = to_bytes(bundle)
    try:
        Path(path).write_bytes(data)
    except OSError as error:
        raise BundleError("{} cannot be written: {}.".format(path, error.strerror)) from None


def load_bundle(path: Union[str, Path]) -> Bundle:
    """The bundle in a file.

    Raises:
        BundleError: The file cannot be read, was changed, or is no bundle of a known format.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise BundleError("{} cannot be read: {}.".format(path, error.strerror)) from None
    try:
        return from_bytes(data)
    except BundleError as error:
        raise BundleError("{}: {}".format(path, error)) from None


def to_bytes(bundle: Bundle) -> bytes:
    """The content of a bundle's file."""
    arrays = _arrays(bundle)
    content = {
        "format": FORMAT,
        "layers": len(bundle.layers),
        "activation": bundle.activation,
        "observation": {
            "shape": list(bundle.observation.shape),
            "clip": float(bundle.observation.clip),
            "details": dict(bundle.observation.details),
        },
        "action": _action_content(bundle.action),
        "task": dict(bundle.task),
        "rate": bundle.rate,
        "provenance": dict(bundle.provenance),
    }
    content["sha256"] = _digest(content, arrays)
    files = {_CONTENT: json.dumps(content, indent=2, sort_keys=True).encode()}
    files.update({name + ".npy": _npy(array) for name, array in arrays.items()})
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, _LONG_AGO), data)
    return stream.getvalue()


def from_bytes(data: bytes) -> Bundle:
    """The inverse of `to_bytes`.

    Raises:
        BundleError: It was changed, or is no bundle of a known format.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _refuse_compression(archive)
            content = json.loads(archive.read(_CONTENT).decode())
            _refuse_other_formats(content)
            arrays = {
                name[: -len(".npy")]: _array(archive.read(name))
                for name in archive.namelist()
                if name.endswith(".npy")
            }
    except BundleError:
        raise
    # Whatever a damaged archive, JSON text or array makes their readers say.
    except _DAMAGES as error:
        raise BundleError("it is damaged, or no bundle: {}.".format(error)) from None
    digest = content.pop("sha256", None)
    if digest != _digest(content, arrays):
        raise BundleError(
            "it was changed after it was written: its digest is another. Copy it anew."
        )
    try:
        return _bundle(content, arrays)
    except BundleError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise BundleError("a part is missing or wrong: {}.".format(error)) from None


def _refuse_compression(archive: zipfile.ZipFile) -> None:
    """A few bytes could otherwise unpack to more than the memory holds."""
    for entry in archive.infolist():
        if entry.compress_type != zipfile.ZIP_STORED:
            raise BundleError(
                "{} in it is compressed; in a bundle nothing is.".format(entry.filename)
            )


def _refuse_other_formats(content: Any) -> None:
    if not isinstance(content, dict) or "format" not in content:
        raise BundleError("it is no bundle: its {} names no format.".format(_CONTENT))
    if content["format"] != FORMAT:
        provenance = content.get("provenance")
        writer = provenance.get("written_by") if isinstance(provenance, dict) else None
        raise BundleError(
            "its format is {}, written by {}; this hprs reads format {}. "
            "Use the version that wrote it.".format(
                content["format"], writer or "an unknown version", FORMAT
            )
        )


def _arrays(bundle: Bundle) -> Dict[str, np.ndarray]:
    arrays: Dict[str, Any] = {}
    for number, layer in enumerate(bundle.layers):
        arrays["weights-{}".format(number)] = layer.weights
        arrays["bias-{}".format(number)] = layer.bias
    arrays["mean"] = bundle.observation.mean
    arrays["deviation"] = bundle.observation.deviation
    if isinstance(bundle.action, BoxLayout):
        arrays["low"], arrays["high"] = bundle.action.low, bundle.action.high
    arrays["check-observations"] = bundle.check_observations
    arrays["check-actions"] = bundle.check_actions
    return {name: np.asarray(array) for name, array in arrays.items() if array is not None}


def _action_content(action: ActionLayout) -> Dict[str, Any]:
    content: Dict[str, Any]
    if isinstance(action, ChoiceLayout):
        content = {"kind": "choice", "outputs": action.outputs, "start": action.start}
    else:
        content = {"kind": "box", "shape": list(action.shape), "mapping": action.mapping}
    # Older bundles of this format have none, and their bytes stay what they are.
    if action.details:
        content["details"] = dict(action.details)
    return content


def _bundle(content: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Bundle:
    seen, acts = content["observation"], content["action"]
    details = dict(acts.get("details", {}))
    action: ActionLayout
    if acts["kind"] == "choice":
        action = ChoiceLayout(int(acts["outputs"]), int(acts["start"]), details)
    elif acts["kind"] == "box":
        action = BoxLayout(_shape(acts), arrays["low"], arrays["high"], acts["mapping"], details)
    else:
        raise BundleError("an action is a box or a choice, not {!r}.".format(acts["kind"]))
    return Bundle(
        layers=tuple(
            Layer(arrays["weights-{}".format(number)], arrays["bias-{}".format(number)])
            for number in range(content["layers"])
        ),
        observation=ObservationLayout(
            shape=_shape(seen),
            mean=arrays.get("mean"),
            deviation=arrays.get("deviation"),
            clip=float(seen["clip"]),
            details=dict(seen["details"]),
        ),
        action=action,
        activation=content["activation"],
        task=dict(content["task"]),
        rate=content["rate"],
        provenance=dict(content["provenance"]),
        check_observations=arrays.get("check-observations"),
        check_actions=arrays.get("check-actions"),
    )


def _shape(content: Mapping[str, Any]) -> Tuple[int, ...]:
    shape = tuple(int(length) for length in content["shape"])
    if any(length < 0 for length in shape):
        raise BundleError("a shape has no negative lengths, as {} does.".format(shape))
    return shape


def _digest(content: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> str:
    found = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    for name in sorted(arrays):
        found.update(name.encode() + b"\0" + _npy(arrays[name]))
    return found.hexdigest()


def _npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)
    return stream.getvalue()


def _array(data: bytes) -> np.ndarray:
    return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
