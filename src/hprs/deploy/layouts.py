"""How an observation enters a network, and how its outputs become an action."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Mapping, Optional, Tuple, Union

import numpy as np

from hprs.errors import BundleError

MAPPINGS = ("clip", "tanh", "raw")
"""How an output becomes a number of an action; see `BoxLayout.mapping`."""


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

    @property
    def size(self) -> int:
        """Numbers in an observation."""
        return int(np.prod(self.shape, dtype=int))

    def rows(self, observations: Any) -> np.ndarray:
        """Observations (B, *shape) as the network sees them, (B, n) float32.

        Raises:
            BundleError: They have another shape, or hold NaN.
        """
        given = np.asarray(observations, np.float32)
        if given.ndim < 1 or given.shape[1:] != self.shape:
            raise BundleError(
                "This policy sees observations of shape {}, not {}.".format(
                    self.shape, given.shape[1:]
                )
            )
        rows = given.reshape(len(given), self.size)
        if np.isnan(rows).any():
            row, column = np.argwhere(np.isnan(rows))[0]
            raise BundleError(
                "Component {} of observation {} is NaN.".format(int(column), int(row))
            )
        if self.mean is None or self.deviation is None:
            return rows
        return np.clip((rows - self.mean) / self.deviation, -self.clip, self.clip)


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
    """`clip`: from -1 to 1, beyond that clipped, to the bounds; `tanh`: the hyperbolic tangent to
    the bounds; `raw`: y itself. Where a bound is infinite y is taken itself. All are clipped."""

    @property
    def outputs(self) -> int:
        """Of the network."""
        return len(self.low)

    def actions(self, outputs: np.ndarray) -> np.ndarray:
        """Actions (B, *shape) float32 from outputs (B, m)."""
        if self.mapping != "raw":
            bounded = np.isfinite(self.low) & np.isfinite(self.high)
            low, high = np.where(bounded, self.low, 0), np.where(bounded, self.high, 0)
            part = np.tanh(outputs) if self.mapping == "tanh" else outputs
            scaled = (low + high) / 2 + (high - low) / 2 * part
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

    def actions(self, outputs: np.ndarray) -> np.ndarray:
        """Actions (B,) int64 from outputs (B, m)."""
        return self.start + np.argmax(outputs, axis=-1)


ActionLayout = Union[BoxLayout, ChoiceLayout]
