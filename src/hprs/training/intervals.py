"""95 % confidence intervals over episodes.

Wilson's score interval for fractions of episodes (Wilson, 1927), the bias-corrected and accelerated
bootstrap for means (Efron, 1987).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

LEVEL = 0.95
RESAMPLES = 5_000

_NORMAL = NormalDist()


def wilson(successes: int, count: int) -> tuple[float, float]:
    """The interval of a fraction of which `successes` of `count` were seen."""
    z = _NORMAL.inv_cdf(0.5 + LEVEL / 2)
    fraction = successes / count
    centre = fraction + z * z / (2 * count)
    spread = z * math.sqrt(fraction * (1 - fraction) / count + z * z / (4 * count * count))
    scale = 1 + z * z / count
    low = 0.0 if successes == 0 else (centre - spread) / scale
    high = 1.0 if successes == count else (centre + spread) / scale
    return low, high


def bootstrap_mean(values: Sequence[float], *, seed: int = 0) -> tuple[float, float]:
    """The interval of a mean; a single point where all values are the same."""
    sample = np.asarray(values, dtype=float)
    if len(sample) < 2 or np.ptp(sample) == 0.0:
        return float(sample.mean()), float(sample.mean())
    generator = np.random.default_rng(seed)
    means = sample[generator.integers(len(sample), size=(RESAMPLES, len(sample)))].mean(axis=1)
    below = np.mean(means < sample.mean()) + np.mean(means == sample.mean()) / 2
    bias = _NORMAL.inv_cdf(float(np.clip(below, 1 / RESAMPLES, 1 - 1 / RESAMPLES)))
    # Leaving one value out moves the mean by a multiple of its deviation.
    deviation = sample - sample.mean()
    acceleration = (deviation**3).sum() / (6 * (deviation**2).sum() ** 1.5)
    ends: list[float] = []
    for tail in ((1 - LEVEL) / 2, (1 + LEVEL) / 2):
        shifted = bias + _NORMAL.inv_cdf(tail)
        level = _NORMAL.cdf(bias + shifted / (1 - acceleration * shifted))
        ends.append(float(np.quantile(means, level)))
    return ends[0], ends[1]
