"""Checks a recorded trace, and counts where its signals left their ranges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from decimal import Decimal
from numbers import Real
from typing import Any, Literal, TypeAlias, cast, get_args

import numpy as np

from hprs.errors import TraceError, UsageError, did_you_mean
from hprs.semantics.evaluation import Signals
from hprs.semantics.plan import Plan
from hprs.spec.misuse import shown
from hprs.spec.namespace import Array, namespace_of, truth
from hprs.spec.task import Task

TOO_SHORT = "the trace needs the initial state and at least one step."

Missing: TypeAlias = Literal["error", "unknown"]
MISSING: tuple[Missing, ...] = get_args(Missing)
"""What a signal makes that a trace lacks, wholly or in some states: an error, or requirements that
are unknown."""


def check_missing(missing: object) -> None:
    """Refuse what does not say what to do without a signal.

    Raises:
        UsageError: It is none of `MISSING`.
    """
    if missing not in MISSING:
        raise UsageError(
            f"missing is {' or '.join(MISSING)}, got {shown(missing)}."
            f"{did_you_mean(str(missing), MISSING)}"
        )


def check_trace(
    plan: Plan, trace: Signals, *, missing: Missing = "error", first: int = 0, least: int = 2
) -> dict[str, Array]:
    """The signals that a task uses, as arrays with time on their first axis.

    Args:
        plan: The task's plan.
        trace: Signal name to values over time.
        missing: With `"unknown"`, signals that the trace lacks are left out, and NaN is let pass.
        first: Number of the first state, for messages.
        least: The number of states that it must have.

    Raises:
        TraceError: See `hprs.assess`.
    """
    if not hasattr(trace, "keys"):
        raise TraceError(f"a trace maps names of signals to values over time, got {trace!r:.80}.")
    if not plan.signals:
        raise TraceError("the task reads no signal, so that a trace says nothing of it.")
    present = [name for name in plan.signals if name in trace]
    if missing == "error":
        _require_all(plan, trace)
    elif not present:
        raise TraceError(
            f"the trace has none of the signals that the task reads ({', '.join(plan.signals)}); "
            f"it has {', '.join(trace)}."
        )
    values = {name: _numbers(name, trace[name]) for name in present}
    xp = namespace_of(values.values())
    _check_shapes(plan, {name: tuple(value.shape) for name, value in values.items()}, least)
    for name, value in values.items() if missing == "error" else ():
        unknown = xp.isnan(value * 1.0)
        if truth(xp.any(unknown)):
            step = first + int(np.argwhere(np.asarray(unknown))[0][0])
            raise TraceError(f"signal '{name}' is NaN at step {step} of the trace.")
    return values


def _require_all(plan: Plan, trace: Signals) -> None:
    for name in plan.signals:
        if name not in trace:
            raise TraceError(
                f"the trace has no signal '{name}'; it has {', '.join(trace)}."
                f"{did_you_mean(name, trace)} With missing='unknown' the requirements that need it "
                "are unknown."
            )


def _numbers(name: str, value: Any) -> Array:
    """An array of numbers: float64 of NumPy, or an array of JAX or PyTorch as it is."""
    if isinstance(value, np.ma.MaskedArray):
        raise TraceError(
            f"in the trace, signal '{name}' is a masked array. Fill or drop what is masked."
        )
    # Tables have columns with a shape, which are no arrays.
    if hasattr(value, "shape") and not hasattr(value, "to_numpy") and _is_foreign(value):
        return value
    try:
        return _as_numpy(value)
    except (TypeError, ValueError):
        raise TraceError(f"in the trace, signal '{name}' {_first_wrong(value)}.") from None


def _is_foreign(value: Any) -> bool:
    """Whether it is an array of real numbers that is not NumPy's."""
    try:
        xp = namespace_of((value,))
    except TypeError:
        return False
    return xp is not np and xp.isdtype(value.dtype, ("bool", "integral", "real floating"))


def _as_numpy(value: Any) -> Array:
    # Wrappers compute in float64 too: 0.05 is less than the float32 nearest to it.
    found: Any = np.asarray(value)
    real = found.dtype.kind in "fiub" or (
        found.dtype.kind == "O" and all(isinstance(one, Real | Decimal) for one in found.flat)
    )
    if not real:
        raise TypeError
    return found.astype(np.float64, copy=False)


def _first_wrong(value: Any) -> str:
    """Says which state of a signal is no number, or has another shape than the one before."""
    shape: tuple[int, ...] | None = None
    listed = isinstance(value, Iterable) and not isinstance(value, str)
    for step, state in enumerate(cast("Iterable[Any]", value) if listed else ()):
        try:
            found = _as_numpy(state).shape
        except (TypeError, ValueError):
            return f"must hold numbers, but is {state!r:.80} at step {step}"
        if shape not in (None, found):
            return f"has shape {found} at step {step}, after shape {shape}"
        shape = found
    return f"must hold numbers, but is {value!r:.80}"


def _check_shapes(plan: Plan, shapes: Mapping[str, tuple[int, ...]], least: int) -> None:
    lengths = {name: shape[0] if shape else 0 for name, shape in shapes.items()}
    if len(set(lengths.values())) > 1:
        raise TraceError(f"the signals of the trace differ in length: {lengths}.")
    if min(lengths.values()) < least:
        raise TraceError(TOO_SHORT)
    vectors = {signal.name: signal.length for signal in plan.task.signals if signal.length}
    batches: dict[str, tuple[int, ...]] = {}
    for name, shape in shapes.items():
        if name in vectors and (len(shape) < 2 or shape[-1] != vectors[name]):
            raise TraceError(
                f"signal '{name}' has {vectors[name]} components, but shape {shape} in the trace."
            )
        batches[name] = shape[:-1] if name in vectors else shape
    first = next(iter(shapes))
    for name, batch in batches.items():
        # Broadcasting would line time up with a batch axis.
        if batch != batches[first]:
            raise TraceError(
                f"signal '{name}' has shape {shapes[name]} in the trace, "
                f"which does not go with '{first}' of shape {shapes[first]}."
            )


def refuse_nan(plan: Plan, margins: Array, *, first: int = 0) -> None:
    """Refuse margins that are NaN although no signal is, as of the square root of -1.

    Under `jax.jit` nothing can be refused.

    Args:
        plan: The task's plan.
        margins: Rows of `Evaluation.margins`, with time on the next axis and batch axes after it.
        first: Number of the first state, for messages.

    Raises:
        TraceError: One is NaN.
    """
    xp = namespace_of((margins,))
    unknown = xp.isnan(margins)
    if truth(xp.any(unknown)):
        row, step = (int(index) for index in np.argwhere(np.asarray(unknown))[0][:2])
        raise TraceError(
            f"the margin of requirement '{plan.labels[row]}' is NaN at step {first + step}: a "
            "signal has left the range in which its expression is defined."
        )


def count_outside(task: Task, values: Mapping[str, Array]) -> dict[str, Any]:
    """Signal name to the number of states in which it left its range; only those that did.

    Under `jax.jit` nothing can be left out or in by its value, and the counts are empty.
    """
    found: dict[str, Any] = {}
    for signal in task.signals:
        if signal.name in values:
            bounds, value = task.ranges[signal.name], values[signal.name]
            left = (value < bounds.low) | (value > bounds.high)
            if signal.length is not None:
                left = namespace_of((left,)).any(left, axis=-1)
            count = left.sum(0)
            if truth(count.any()):
                found[signal.name] = count
    return found
