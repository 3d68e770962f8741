"""95 % confidence intervals over episodes.

Wilson's score interval for fractions of episodes (Wilson, 1927), and SciPy's bias-corrected and
accelerated bootstrap for means (Efron, 1987).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from hprs.training.environment import require

LEVEL = 0.95
RESAMPLES = 5_000

_ROUNDING = 1e-9
"""Measures are of the order of 1: what differs by less differs by rounding."""
_BATCH = 5_000_000
"""Numbers that the bootstrap draws at once, which bounds its memory."""


def require_statistics() -> None:
    """See that intervals can be computed, before any episode is run for them.

    Raises:
        MissingExtraError: SciPy is not installed.
    """
    require("scipy", "report")


def wilson(successes: int, count: int) -> tuple[float, float]:
    """The interval of a fraction of which `successes` of `count` were seen, in closed form."""
    fraction, z = successes / count, NormalDist().inv_cdf((1 + LEVEL) / 2)
    middle = fraction + z**2 / (2 * count)
    half = z * math.sqrt(fraction * (1 - fraction) / count + z**2 / (4 * count**2))
    scale = 1 + z**2 / count
    # At the ends the two terms are equal but for rounding.
    low = (middle - half) / scale if successes else 0.0
    return low, (middle + half) / scale if successes < count else 1.0


def bootstrap_mean(values: Sequence[float], *, seed: int = 0) -> tuple[float, float]:
    """The interval of a mean; a single point where all values, of the order of 1, are the same."""
    sample = np.asarray(values, dtype=float)
    if len(sample) < 2 or np.ptp(sample) <= _ROUNDING:
        return float(sample.mean()), float(sample.mean())
    require_statistics()
    from scipy import stats

    found = stats.bootstrap(
        (sample,),
        np.mean,
        n_resamples=RESAMPLES,
        batch=max(1, _BATCH // len(sample)),
        confidence_level=LEVEL,
        method="BCa",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return float(found.low), float(found.high)
