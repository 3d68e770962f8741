"""Sliding windows over the last values of a sequence: what filtering semantics makes of them.

A filter looks at the last `size` values (all of them while there are fewer). It is begun with the
first value and pushed one value at a time; nothing but its window is remembered:

| filter | value | a step on floats, amortised | on a batch |
|---|---|---|---|
| `LEAST` | minimum | O(1) | O(size) |
| `MEAN` | mean | O(1) | O(size) |
| `MEAN_OF_MINIMA` | mean over positions of the minimum from there on | O(1) | O(size) |
| `RUN` | the same of 0 and 1: the share of the window since the last 0 | O(1) | O(1) |
| `ALL` | minimum of 0 and 1 | O(1) | O(1) |

Floats are kept in blocks of `size` values: a window is the end of one full block, whose suffixes
are summed up once, and the beginning of the next. Lists only ever grow at their end, and a window
knows its own length, so that a memory is never changed by pushing a value onto it.

NaN makes a window NaN, and leaves with the value that it was.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import accumulate
from typing import Any, NamedTuple, cast

from hprs.spec.namespace import Array, float_operations, namespace_of


class Filter(NamedTuple):
    """A sliding window as pure functions; a memory is made of arrays and numbers in tuples."""

    begin: Callable[[Array, int], Any]
    """The memory of a first value and a window's size."""
    push: Callable[[Any, Array, int], Any]
    """The memory one value later."""
    value: Callable[[Any, int], Array]
    """What the window is worth."""


class _Block(NamedTuple):
    """A window over floats for `LEAST` and `MEAN`."""

    full: list[float] | None
    """Of the block before: for `LEAST` its suffix minima, for `MEAN` its values."""
    values: list[float]
    """The running block, and maybe what a later window has appended."""
    length: int
    """How many of them count."""
    head: float
    """Minimum or sum of the running block."""
    tail: float
    """Sum of the values of the block before that are still in the window."""


# Twice as fast as the named constructors.
_new: Callable[..., Any] = cast(Any, tuple).__new__

# Python's own hides NaN where it comes second.
_smaller = float_operations()["min"]


class _Shifted(NamedTuple):
    """A window over a batch: the newest value is the last on the last axis."""

    values: Array
    """Values, or minima from each position on."""
    count: Array
    """How many of them are real, as floating-point numbers."""


class _Minima(NamedTuple):
    """A window over floats for `MEAN_OF_MINIMA`."""

    minima: list[float] | None
    """Suffix minima of the block before; they never fall."""
    sums: list[float]
    """Their suffix sums, and 0."""
    crossing: int
    """From here on, those minima are above everything in the running block."""
    values: list[float]
    links: list[int]
    """For each value the position of the last smaller one before it in its block, or -1."""
    totals: list[float]
    """For each value the sum over its block up to it of minima from each position to it."""
    length: int
    """How many of the last three count."""
    least: float
    """Minimum of the running block."""


def _appended(items: list[Any], length: int, item: Any) -> list[Any]:
    """The first `length` items and one more, in the same list where nothing else follows them."""
    if len(items) != length:
        items = items[:length]
    items.append(item)
    return items


def _suffix_minima(values: list[float]) -> list[float]:
    return list(accumulate(reversed(values), _smaller))[::-1]


def _begin_least(value: Array, size: int) -> Any:
    if isinstance(value, float):
        return _Block(None, [value], 1, value, 0.0)
    return _begin_shifted(value, size, fill=value)


def _push_least(memory: Any, value: Array, size: int) -> Any:
    if not isinstance(memory, _Block):
        return _push_minimum(memory, value, size)
    full, values, length, head, _ = memory
    if length == size:
        return _new(_Block, (_suffix_minima(values[:size]), [value], 1, value, 0.0))
    # A head of NaN stays, and a value of NaN replaces any.
    head = head if head <= value or head != head else value
    return _new(_Block, (full, _appended(values, length, value), length + 1, head, 0.0))


def _least(memory: Any, size: int) -> Array:
    if not isinstance(memory, _Block):
        return memory.values[..., 0]
    full, _, length, head, _ = memory
    return head if full is None or length == size else _smaller(full[length], head)


def _begin_mean(value: Array, size: int) -> Any:
    if isinstance(value, float):
        return _Block(None, [value], 1, value, 0.0)
    return _begin_shifted(value, size, fill=namespace_of((value,)).zeros_like(value))


def _push_mean(memory: Any, value: Array, size: int) -> Any:
    if not isinstance(memory, _Block):
        return _Shifted(_shift(memory.values, value), _counted(memory.count, size))
    full, values, length, head, tail = memory
    if length == size:
        # A sum that begins anew with every block gathers no rounding over an episode.
        tail = _less(head, values, 0, size)
        return _new(_Block, (values, [value], 1, value, tail))
    tail = 0.0 if full is None else _less(tail, full, length, size)
    return _new(_Block, (full, _appended(values, length, value), length + 1, head + value, tail))


def _less(total: float, values: list[float], index: int, size: int) -> float:
    """A sum of values from an index on, without the first of them."""
    total -= values[index]
    # NaN cannot be subtracted, nor infinity: what is left is summed up anew.
    return total if total == total else sum(values[index + 1 : size], 0.0)


def _mean(memory: Any, size: int) -> Array:
    if isinstance(memory, _Block):
        return (memory.tail + memory.head) / (memory.length if memory.full is None else size)
    return _sum(memory.values) / memory.count


def _begin_minima(value: Array, size: int) -> Any:
    if isinstance(value, float):
        return _Minima(None, [], 0, [value], [-1], [value], 1, value)
    return _begin_shifted(value, size, fill=value)


def _push_minima(memory: Any, value: Array, size: int) -> Any:
    if not isinstance(memory, _Minima):
        return _push_minimum(memory, value, size)
    if memory.length == size:
        minima = _suffix_minima(memory.values[:size])
        sums = list(accumulate(reversed(minima), initial=0.0))[::-1]
        memory = _Minima(minima, sums, size, [], [], [], 0, value)
    minima, sums, crossing, values, links, totals, length, least = memory
    link = length - 1
    while link >= 0 and values[link] >= value:
        link = links[link]
    total = value * (length - link) + (totals[link] if link >= 0 else 0.0)
    least = value if value < least else least
    if minima is not None:
        while crossing > 0 and minima[crossing - 1] > least:
            crossing -= 1
    return _new(
        _Minima,
        (
            minima,
            sums,
            crossing,
            _appended(values, length, value),
            _appended(links, length, link),
            _appended(totals, length, total),
            length + 1,
            least,
        ),
    )


def _mean_of_minima(memory: Any, size: int) -> Array:
    if not isinstance(memory, _Minima):
        # What is not real yet is the minimum of all that is.
        missing = size - memory.count
        return (_sum(memory.values) - missing * memory.values[..., 0]) / memory.count
    minima, sums, crossing, _, _, totals, length, least = memory
    if minima is None:
        return totals[length - 1] / length
    crossing = max(crossing, length)
    before = sums[length] - sums[crossing] + (size - crossing) * least
    return (before + totals[length - 1]) / size


def _begin_run(value: Array, size: int) -> Any:
    del size
    return (value, value * 0.0 + 1.0)


def _push_run(memory: Any, value: Array, size: int) -> Any:
    run, count = memory
    if isinstance(value, float):
        count = count + 1.0 if count < size else count
        return (min(run + 1.0, count) if value else 0.0, count)
    count = _counted(count, size)
    return (namespace_of((run,)).minimum(run + 1.0, count) * value, count)


def _run(memory: Any, size: int) -> Array:
    del size
    run, count = memory
    return run / count


def _all(memory: Any, size: int) -> Array:
    del size
    run, count = memory
    if isinstance(run, float):
        return float(run == count)
    return namespace_of((run,)).astype(run == count, run.dtype)


def _begin_shifted(value: Array, size: int, *, fill: Array) -> _Shifted:
    xp = namespace_of((value,))
    filled = xp.broadcast_to(fill[..., None], (*value.shape, size))
    return _Shifted(_shift(filled, value), xp.ones_like(value))


def _shift(values: Array, value: Array) -> Array:
    xp = namespace_of((values,))
    return xp.concat([values[..., 1:], value[..., None]], axis=-1)


def _push_minimum(memory: _Shifted, value: Array, size: int) -> _Shifted:
    shifted = _shift(memory.values, value)
    least = namespace_of((shifted,)).minimum(shifted, value[..., None])
    return _Shifted(least, _counted(memory.count, size))


def _counted(count: Array, size: int) -> Array:
    return namespace_of((count,)).where(count < size, count + 1.0, count)


def _sum(values: Array) -> Array:
    return namespace_of((values,)).sum(values, axis=-1)


LEAST = Filter(_begin_least, _push_least, _least)
MEAN = Filter(_begin_mean, _push_mean, _mean)
MEAN_OF_MINIMA = Filter(_begin_minima, _push_minima, _mean_of_minima)
RUN = Filter(_begin_run, _push_run, _run)
ALL = Filter(_begin_run, _push_run, _all)
