"""95 % confidence intervals over episodes, by SciPy.

Wilson's score interval for fractions of episodes (Wilson, 1927), the bias-corrected and accelerated
bootstrap for means (Efron, 1987).
"""

from __future__ import annotations

from collections.abc import Sequence

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
    """The interval of a fraction of which `successes` of `count` were seen."""
    require_statistics()
    from scipy import stats

    found = stats.binomtest(successes, count).proportion_ci(LEVEL, method="wilson")
    return float(found.low), float(found.high)


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
