"""Writes a bundle's policy as an ONNX file: normalisation, network and action in one graph."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, List, Union

import numpy as np

from hprs.deploy.bundle import Bundle
from hprs.deploy.layouts import ChoiceLayout
from hprs.errors import BundleError, MissingExtraError

try:
    import onnx
    from onnx import TensorProto, helper, numpy_helper
except ModuleNotFoundError as error:
    if error.name != "onnx":
        raise
    raise MissingExtraError("onnx", "onnx") from None

OPSET = 17
"""Of the operators; runtimes since 2022 know it."""
IR_VERSION = 8
"""Of the file; as old as the operators."""
OBSERVATION, ACTION = "observation", "action"
"""Names of the input and of the output; both have the batch on their first axis."""


def save_onnx(bundle: Bundle, path: Union[str, Path]) -> None:
    """Write a bundle's policy into an ONNX file.

    Raises:
        BundleError: The file cannot be written.
    """
    data = to_model(bundle).SerializeToString()
    try:
        Path(path).write_bytes(data)
    except OSError as error:
        raise BundleError("{} cannot be written: {}.".format(path, error.strerror)) from None


def to_model(bundle: Bundle) -> Any:
    """The model, checked; its metadata hold task, rate, layouts and provenance as JSON."""
    graph = _Graph()
    outputs = graph.network(bundle, graph.rows(bundle))
    choice = isinstance(bundle.action, ChoiceLayout)
    graph.action(bundle, outputs)
    made = helper.make_graph(
        graph.nodes,
        "policy",
        [_value(OBSERVATION, TensorProto.FLOAT, bundle.observation.shape)],
        [_value(ACTION, TensorProto.INT64 if choice else TensorProto.FLOAT, bundle.action.shape)],
        graph.constants,
    )
    writer = str(bundle.provenance.get("written_by", "hprs"))
    model = helper.make_model(
        made,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name=writer,
    )
    helper.set_model_props(
        model,
        {
            "task": json.dumps(dict(bundle.task)),
            "rate": json.dumps(bundle.rate),
            "observation": json.dumps(dict(bundle.observation.details)),
            "action": json.dumps(dict(bundle.action.details)),
            "provenance": json.dumps(dict(bundle.provenance)),
        },
    )
    onnx.checker.check_model(model, full_check=True)
    return model


def _value(name: str, kind: int, shape: Any) -> Any:
    return helper.make_tensor_value_info(name, kind, ["batch"] + list(shape))


class _Graph:
    """Nodes and constants, as they are added."""

    def __init__(self) -> None:
        self.nodes: List[Any] = []
        self.constants: List[Any] = []

    def rows(self, bundle: Bundle) -> str:
        """Observations as the network sees them."""
        seen = bundle.observation
        rows = self._node("Reshape", OBSERVATION, self._constant(np.array([-1, seen.size])))
        if seen.mean is None or seen.deviation is None:
            return rows
        rows = self._node("Sub", rows, self._number(seen.mean))
        rows = self._node("Div", rows, self._number(seen.deviation))
        clip = float(seen.clip)
        return self._node("Clip", rows, self._number(-clip), self._number(clip))

    def network(self, bundle: Bundle, rows: str) -> str:
        """Outputs of the network."""
        for number, layer in enumerate(bundle.layers):
            if number:
                rows = self._node(bundle.activation.capitalize(), rows)
            rows = self._node("MatMul", rows, self._number(layer.weights))
            rows = self._node("Add", rows, self._number(layer.bias))
        return rows

    def action(self, bundle: Bundle, outputs: str) -> None:
        """What outputs become; see `hprs.deploy.layouts`."""
        action = bundle.action
        if isinstance(action, ChoiceLayout):
            best = self._node("ArgMax", outputs, axis=-1, keepdims=0)
            self._node("Add", best, self._constant(np.array(action.start)), output=ACTION)
            return
        if action.mapping != "raw":
            bounded, centre, half = action.scale
            part = self._node("Tanh", outputs) if action.mapping == "tanh" else outputs
            scaled = self._node("Mul", part, self._number(half))
            scaled = self._node("Add", scaled, self._number(centre))
            outputs = self._node("Where", self._constant(bounded), scaled, outputs)
        outputs = self._node("Max", outputs, self._number(action.low))
        outputs = self._node("Min", outputs, self._number(action.high))
        shape = self._constant(np.array((-1,) + action.shape))
        self._node("Reshape", outputs, shape, output=ACTION)

    def _number(self, value: Any) -> str:
        return self._constant(np.asarray(value, np.float32))

    def _constant(self, value: np.ndarray) -> str:
        name = "constant-{}".format(len(self.constants))
        self.constants.append(numpy_helper.from_array(value, name))
        return name

    def _node(self, operator: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        output = output or "value-{}".format(len(self.nodes))
        self.nodes.append(helper.make_node(operator, inputs, [output], **attributes))
        return output
