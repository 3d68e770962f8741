"""A policy as data: weights, what it sees, what it does, and what it was trained for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from hprs.deploy.layouts import MAPPINGS, ActionLayout, BoxLayout, ObservationLayout
from hprs.errors import BundleError

TOLERANCE = 1e-5
"""Of a self-check, over the largest action that it expects, or over 1."""

_ACTIVATIONS = {"tanh": np.tanh, "relu": lambda x: np.maximum(x, 0)}


class Layer(NamedTuple):
    """An affine map."""

    weights: np.ndarray
    """(inputs, outputs) float32."""
    bias: np.ndarray
    """(outputs,) float32."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """A deterministic policy that needs nothing but NumPy.

    Raises:
        BundleError: Its parts do not fit together.
    """

    layers: Tuple[Layer, ...]
    """Of the network, the last one without an activation."""
    observation: ObservationLayout
    action: ActionLayout
    activation: str = "tanh"
    """Between the layers: `tanh` or `relu`."""
    task: Mapping[str, Any] = field(default_factory=dict)
    """The task that it was trained for, as JSON."""
    rate: Optional[float] = None
    """Decisions a second in training, Hz; None where an environment does not say."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """Run, step, versions: JSON values."""
    check_observations: Optional[np.ndarray] = None
    """Observations to check itself with, (K, n) float32, flattened."""
    check_actions: Optional[np.ndarray] = None
    """The actions that the trainer's own network takes there, (K, ...)."""

    def __post_init__(self) -> None:
        if self.activation not in _ACTIVATIONS:
            known = ", ".join(_ACTIVATIONS)
            raise BundleError("activation is one of {}, not {!r}.".format(known, self.activation))
        if isinstance(self.action, BoxLayout) and self.action.mapping not in MAPPINGS:
            known = ", ".join(MAPPINGS)
            raise BundleError("mapping is one of {}, not {!r}.".format(known, self.action.mapping))
        size = self.observation.size
        for number, layer in enumerate(self.layers):
            if layer.weights.ndim != 2 or layer.weights.shape[0] != size:
                raise BundleError(
                    "layer {} takes {} numbers, but is given {}.".format(
                        number, layer.weights.shape[:1], size
                    )
                )
            size = layer.weights.shape[1]
            if layer.bias.shape != (size,):
                raise BundleError(
                    "the bias of layer {} has shape {}, not {}.".format(
                        number, layer.bias.shape, (size,)
                    )
                )
        if size != self.action.outputs:
            raise BundleError(
                "the network has {} outputs, the action needs {}.".format(size, self.action.outputs)
            )

    def __call__(self, observation: Any) -> Any:
        """The action in one observation of the environment; see `batch`."""
        return self.batch(np.asarray(observation, np.float32)[None])[0]

    def batch(self, observations: Any) -> np.ndarray:
        """One action for each observation, (B, ...).

        Raises:
            BundleError: They have another shape than in training, or hold NaN.
        """
        return self.action.actions(self.network(self.observation.rows(observations)))

    def network(self, rows: np.ndarray) -> np.ndarray:
        """Outputs (B, m) for normalised observations (B, n)."""
        activation = _ACTIVATIONS[self.activation]
        for layer in self.layers[:-1]:
            rows = activation(rows @ layer.weights + layer.bias)
        return rows @ self.layers[-1].weights + self.layers[-1].bias

    def self_check(self) -> None:
        """See that this machine computes the actions that the trainer did.

        Raises:
            BundleError: One differs, or there is nothing to check with.
        """
        if self.check_observations is None or self.check_actions is None:
            raise BundleError("this bundle holds nothing to check itself with.")
        shape = (len(self.check_observations),) + tuple(self.observation.shape)
        found = self.batch(self.check_observations.reshape(shape))
        limit = TOLERANCE * max(1.0, float(np.abs(self.check_actions).max()))
        difference = np.abs(found - self.check_actions).reshape(len(found), -1).max(axis=1)
        # NaN is not below any limit.
        wrong = np.flatnonzero(~(difference <= limit))
        if wrong.size:
            row = int(wrong[0])
            raise BundleError(
                "self-check failed: in observation {} the action is {}, in training it was {}. "
                "Do not use this policy here.".format(row, found[row], self.check_actions[row])
            )
