"""Statistics over the seeds of a training: what a reward is worth, and how sure that is.

A value is one trained policy's, such as its S+T over 50 episodes. Intervals draw whole seeds again,
never episodes pooled over seeds: these are not independent, and there are many of them, so that
pooling them makes any difference look certain (Agarwal et al., 2021).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from hprs.training.environment import require
from hprs.training.intervals import LEVEL

DRAWS = 10_000
"""Of a bootstrap."""
BAND_DRAWS = 1_000
"""Of the band along a curve, which is looked at rather than read."""
FAILED = 0.5
"""A seed whose S+T is below this has not learned the task."""
ENOUGH, IN_A_ROW = 0.9, 3
"""A training is there at the first of three evaluations in a row with an S+T of 0.9."""
_BATCH = 2_000_000
"""Numbers that a bootstrap draws at once, which bounds its memory."""

Numbers = npt.NDArray[np.float64]


def interquartile_mean(values: npt.ArrayLike, axis: int = -1) -> Any:
    """The mean of the middle half of the values; of a value on its edge, the part inside counts.

    Args:
        values: One value a seed along `axis`.
        axis: The axis of the seeds.
    """
    ordered = np.sort(np.moveaxis(np.asarray(values, dtype=float), axis, -1), -1)
    count = ordered.shape[-1]
    after, before = np.arange(1, count + 1), np.arange(count)
    kept = np.clip(np.minimum(after, 0.75 * count) - np.maximum(before, 0.25 * count), 0, 1)
    return ordered @ (kept / kept.sum())


def interval(
    values: npt.ArrayLike, statistic: Callable[..., Any] = np.mean, *, seed: int = 0
) -> tuple[Numbers, Numbers]:
    """The 95 % interval of a statistic over seeds: percentiles of a bootstrap.

    Args:
        values: (..., seeds); with one seed the interval is its value.
        statistic: Takes values and `axis`.
        seed: Of the draws.

    Returns:
        Lower and upper ends, (...).

    Raises:
        MissingExtraError: SciPy is not installed.
    """
    sample = np.asarray(values, dtype=float)
    if sample.shape[-1] < 2:
        only = np.asarray(statistic(sample, axis=-1))
        return only, only
    return _bootstrap((sample,), statistic, seed)


def interquartile_band(values: npt.ArrayLike, *, seed: int = 0) -> tuple[Numbers, Numbers]:
    """The 95 % intervals of the interquartile means along a curve, all of the same draws of seeds.

    Args:
        values: (k, seeds).
        seed: Of the draws.

    Returns:
        Lower and upper ends, (k,).
    """
    sample = np.asarray(values, dtype=float)
    seeds = sample.shape[-1]
    drawn = np.random.default_rng(seed).integers(seeds, size=(BAND_DRAWS, seeds))
    ends = [(1 - LEVEL) / 2, (1 + LEVEL) / 2]
    low, high = np.quantile(interquartile_mean(sample[:, drawn]), ends, axis=-1)
    return low, high


def difference_interval(
    one: npt.ArrayLike,
    other: npt.ArrayLike,
    statistic: Callable[..., Any] = interquartile_mean,
    *,
    seed: int = 0,
) -> tuple[float, float]:
    """The 95 % interval of how much higher the first one's statistic is; both draw their seeds.

    Args:
        one: (seeds,) of the first, at least two.
        other: (seeds,) of the second, at least two.
        statistic: Takes values and `axis`.
        seed: Of the draws.
    """

    def difference(a: Any, b: Any, axis: int) -> Any:
        return statistic(a, axis=axis) - statistic(b, axis=axis)

    low, high = _bootstrap(_pair(one, other), difference, seed)
    return float(low), float(high)


def probability_of_improvement(one: npt.ArrayLike, other: npt.ArrayLike) -> float:
    """How likely a seed of the first is better than one of the second; a tie counts half.

    Args:
        one: (seeds,) of the first.
        other: (seeds,) of the second.
    """
    return float(_probability(*_pair(one, other)))


def improvement_interval(
    one: npt.ArrayLike, other: npt.ArrayLike, *, seed: int = 0
) -> tuple[float, float]:
    """The 95 % interval of `probability_of_improvement`; both draw their seeds, at least two."""
    low, high = _bootstrap(_pair(one, other), _probability, seed)
    return float(low), float(high)


def failed_seeds(values: npt.ArrayLike) -> int:
    """How many seeds have an S+T below `FAILED`."""
    return int((np.asarray(values) < FAILED).sum())


def steps_to(steps: Sequence[int], values: Sequence[float], enough: float = ENOUGH) -> int | None:
    """The first step of `IN_A_ROW` evaluations in a row with a value of `enough`; None if never.

    Args:
        steps: Of the evaluations, in their order.
        values: Their S+T.
        enough: The least value.
    """
    good = [value >= enough for value in values]
    starts = range(len(good) - IN_A_ROW + 1)
    return next((steps[i] for i in starts if all(good[i : i + IN_A_ROW])), None)


def _pair(one: npt.ArrayLike, other: npt.ArrayLike) -> tuple[Numbers, Numbers]:
    return np.asarray(one, dtype=float), np.asarray(other, dtype=float)


def _probability(one: Numbers, other: Numbers, axis: int = -1) -> Any:
    a, b = np.moveaxis(one, axis, -1)[..., :, None], np.moveaxis(other, axis, -1)[..., None, :]
    return ((a > b) + 0.5 * (a == b)).mean(axis=(-1, -2))


def _bootstrap(
    samples: tuple[Numbers, ...], statistic: Callable[..., Any], seed: int
) -> tuple[Numbers, Numbers]:
    require("scipy", "report")
    from scipy import stats

    found = stats.bootstrap(
        samples,
        statistic,
        n_resamples=DRAWS,
        batch=max(1, _BATCH // max(sample.size for sample in samples)),
        vectorized=True,
        axis=-1,
        confidence_level=LEVEL,
        # BCa is undefined where all seeds agree, which good rewards make them do.
        method="percentile",
        rng=np.random.default_rng(seed),
    ).confidence_interval
    return np.asarray(found.low), np.asarray(found.high)
