"""How an observation enters a network, and how its outputs become an action."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Tuple, Union

import numpy as np

from hprs.errors import BundleError

MAPPINGS = ("clip", "tanh", "raw")
"""How an output becomes a number of an action; see `BoxLayout.mapping`."""


def check_array(name: str, array: np.ndarray, shape: Tuple[int, ...]) -> None:
    """See that an array holds real numbers in a shape.

    Raises:
        BundleError: It does not.
    """
    if array.dtype.kind not in "fiu":
        raise BundleError("{} holds {}, not numbers.".format(name, array.dtype))
    if array.shape != shape:
        raise BundleError("{} has shape {}, not {}.".format(name, array.shape, shape))


def _count(shape: Tuple[int, ...]) -> int:
    """Numbers in an array of a shape."""
    return int(np.prod(shape, dtype=int))


@dataclass(frozen=True, eq=False)
class ObservationLayout:
    """Of the environment's observations."""

    shape: Tuple[int, ...]
    """Of one observation; the network sees it flattened, n numbers."""
    mean: Optional[np.ndarray] = None
    """Subtracted first, (n,); None: observations are taken as they are."""
    deviation: Optional[np.ndarray] = None
    """What is left is divided by this, (n,)."""
    clip: float = 10.0
    """What is then clipped to, either way."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """Labels, units, frames, lengths of histories: JSON values, for whoever builds observations."""

    def __post_init__(self) -> None:
        """Raise BundleError where the parts do not fit together."""
        if (self.mean is None) != (self.deviation is None):
            raise BundleError("mean and deviation come together, but one of them is missing.")
        if self.mean is not None and self.deviation is not None:
            check_array("mean", self.mean, (self.size,))
            check_array("deviation", self.deviation, (self.size,))
            if not (self.deviation > 0).all():
                raise BundleError("deviation must be positive, got {}.".format(self.deviation))
        if not self.clip > 0:
            raise BundleError("clip must be positive, got {}.".format(self.clip))

    @property
    def size(self) -> int:
        """Numbers in an observation."""
        return _count(self.shape)

    def rows(self, observations: Any) -> np.ndarray:
        """Observations `(B, *shape)` as the network sees them, (B, n) float32.

        Raises:
            BundleError: They have another shape, or hold NaN; or infinity, where nothing clips it.
        """
        given = np.asarray(observations, np.float32)
        if given.ndim < 1 or given.shape[1:] != self.shape:
            raise BundleError(
                "This policy sees observations of shape {}, not {}.".format(
                    self.shape, given.shape[1:]
                )
            )
        flat = rows = given.reshape(len(given), self.size)
        if self.mean is not None and self.deviation is not None:
            rows = np.clip((flat - self.mean) / self.deviation, -self.clip, self.clip)
        if not np.isfinite(rows).all():
            row, column = np.argwhere(~np.isfinite(rows))[0]
            raise BundleError(
                "Component {} of observation {} is {}.".format(column, row, flat[row, column])
            )
        return rows


@dataclass(frozen=True, eq=False)
class BoxLayout:
    """An action of numbers between bounds, each from one output y."""

    shape: Tuple[int, ...]
    """Of one action."""
    low: np.ndarray
    """Bounds of the numbers, flattened, (m,); may be infinite."""
    high: np.ndarray
    """The upper ones."""
    mapping: str = "clip"
    """`clip`: -1 to 1 is mapped to the bounds; `tanh`: its hyperbolic tangent is; `raw`: y itself.
    Without two finite bounds it is always y itself. What is then beyond a bound is clipped."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """Labels, units and limits: JSON values, for whoever obeys the actions."""

    def __post_init__(self) -> None:
        """Raise BundleError where the parts do not fit together."""
        if self.mapping not in MAPPINGS:
            known = ", ".join(MAPPINGS)
            raise BundleError("mapping is one of {}, not {!r}.".format(known, self.mapping))
        check_array("low", self.low, (self.outputs,))
        check_array("high", self.high, (self.outputs,))
        if not (self.low <= self.high).all():
            raise BundleError("low {} must not be above high {}.".format(self.low, self.high))

    @property
    def outputs(self) -> int:
        """Of the network."""
        return _count(self.shape)

    @property
    def scale(self) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of every number: whether it has two finite bounds, their middle, and half their distance.

        Where it has not, middle and distance are 0.
        """
        bounded = np.isfinite(self.low) & np.isfinite(self.high)
        low, high = np.where(bounded, self.low, 0), np.where(bounded, self.high, 0)
        return bounded, (low + high) / 2, (high - low) / 2

    def actions(self, outputs: np.ndarray) -> np.ndarray:
        """Actions `(B, *shape)` float32 from outputs (B, m)."""
        if self.mapping != "raw":
            bounded, centre, half = self.scale
            part = np.tanh(outputs) if self.mapping == "tanh" else outputs
            scaled = centre + half * part
            outputs = np.where(bounded, scaled, outputs)
        actions = np.clip(outputs, self.low, self.high).astype(np.float32)
        return actions.reshape((len(actions),) + self.shape)


@dataclass(frozen=True, eq=False)
class ChoiceLayout:
    """An action that is one of several choices: that of the largest output."""

    outputs: int
    """Choices, one output each."""
    start: int = 0
    """The first one."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """As of `BoxLayout`."""

    def __post_init__(self) -> None:
        """Raise BundleError where there is nothing to choose."""
        if self.outputs < 1:
            raise BundleError("a choice needs at least one output, got {}.".format(self.outputs))

    @property
    def shape(self) -> Tuple[int, ...]:
        """Of one action: a single number."""
        return ()

    def actions(self, outputs: np.ndarray) -> np.ndarray:
        """Actions (B,) int64 from outputs (B, m)."""
        return self.start + np.argmax(outputs, axis=-1)


ActionLayout = Union[BoxLayout, ChoiceLayout]
