"""Hyper-parameters that change over a training."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

_PREFIX = "linear_"


@dataclass(frozen=True)
class Linear:
    """A hyper-parameter that falls linearly from `start` to 0 over a training."""

    start: float

    def __call__(self, remaining: float) -> float:
        """The value while this fraction of the training remains."""
        return self.start * remaining


def start_of(text: str) -> float | None:
    """The first value of a schedule like "linear_0.001"; None if it is no such text."""
    return number_after(_PREFIX, text)


def number_after(prefix: str, text: str) -> float | None:
    """The finite number that follows a prefix; None if the text is not made so."""
    if not text.startswith(prefix):
        return None
    try:
        number = float(text.removeprefix(prefix))
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def schedule(value: Any) -> Any:
    """A hyper-parameter as Stable-Baselines3 takes it: "linear_0.001" becomes a function."""
    start = start_of(value) if isinstance(value, str) else None
    return value if start is None else Linear(start)
