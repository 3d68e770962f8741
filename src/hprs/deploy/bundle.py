"""A policy as data: weights, what it sees, what it does, and what it was trained for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, NamedTuple, Optional, Tuple

import numpy as np

from hprs.deploy.layouts import ActionLayout, ObservationLayout, check_array
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
    """Where it comes from, as JSON; `written_by` names the program and its version."""
    check_observations: Optional[np.ndarray] = None
    """Observations to check itself with, (K, n) float32, flattened."""
    check_actions: Optional[np.ndarray] = None
    """The actions that the trainer's own network takes there, `(K, *action.shape)`."""

    def __post_init__(self) -> None:
        """Raise BundleError where the parts do not fit together."""
        if self.activation not in _ACTIVATIONS:
            known = ", ".join(_ACTIVATIONS)
            raise BundleError("activation is one of {}, not {!r}.".format(known, self.activation))
        self._check_network()
        if self.check_observations is not None and self.check_actions is not None:
            count = len(self.check_observations)
            check_array(
                "check_observations", self.check_observations, (count, self.observation.size)
            )
            check_array("check_actions", self.check_actions, (count,) + self.action.shape)

    def _check_network(self) -> None:
        if not self.layers:
            raise BundleError("the network has no layers.")
        size = self.observation.size
        for number, (weights, bias) in enumerate(self.layers):
            if weights.ndim != 2 or weights.shape[0] != size:
                raise BundleError(
                    "layer {} has weights of shape {}, but is given {} numbers.".format(
                        number, weights.shape, size
                    )
                )
            size = weights.shape[1]
            for name, array, shape in (
                ("weights", weights, weights.shape),
                ("bias", bias, (size,)),
            ):
                where = "the {} of layer {}".format(name, number)
                check_array(where, array, shape)
                if not np.isfinite(array).all():
                    raise BundleError("{} holds NaN or infinity.".format(where))
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
            BundleError: They have another shape than in training, or hold NaN; see
                `ObservationLayout.rows`.
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
        if not len(self.check_observations):
            raise BundleError("this bundle holds no observations to check itself with.")
        shape = (len(self.check_observations),) + self.observation.shape
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
