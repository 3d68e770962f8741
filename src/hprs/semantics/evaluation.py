"""Margins, satisfaction, scores and the hierarchical potential of states.

One state is a mapping from signal names to floats, a batch is the same with arrays of any batch
shape; NumPy, JAX (under `jit`, `vmap`, `scan`) and PyTorch give the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial, reduce
from types import ModuleType
from typing import Any, TypeAlias, cast

import numpy as np

from hprs.errors import SignalError, did_you_mean
from hprs.semantics.plan import Evaluation, Group, Plan, plan_of
from hprs.semantics.single_state import float_evaluator
from hprs.spec.misuse import shown
from hprs.spec.namespace import (
    Array,
    array_operations,
    as_floating,
    both,
    either,
    namespace_of,
)
from hprs.spec.task import Task

Signals: TypeAlias = Mapping[str, Array]
"""Signal name to value; scalars have the batch shape, vectors one more axis at the end."""


EVALUATION = "(evaluation)"
"""A key that no signal can have."""


def carry(signals: dict[str, Any], task: Task, evaluation: Evaluation) -> None:
    """Let signals carry their evaluation, so that one step evaluates a task once.

    An entry of an ordinary dictionary: Python reads a subclass's entries more slowly.
    """
    signals[EVALUATION] = (task, evaluation)


def evaluate(task: Task, signals: Signals) -> Evaluation:
    """Evaluate a task in one state or in a batch of states.

    Args:
        task: The task.
        signals: Name to value. All values floats: one state. Arrays: a batch of any shape.

    Raises:
        SignalError: A signal that the task uses is missing, or signals are no dictionary.
    """
    try:
        carried = signals.get(EVALUATION)
    except AttributeError:
        raise SignalError(
            f"signals are a dictionary from name to value, got {shown(signals)}."
        ) from None
    if carried is not None and carried[0] is task:
        return carried[1]
    plan = plan_of(task)
    values = pick(plan, signals)
    if all(isinstance(value, int | float) for value in values.values()):
        return evaluate_floats(plan, {name: float(value) for name, value in values.items()})
    return evaluate_arrays(plan, values, namespace_of(values.values()))


def is_single(evaluation: Evaluation) -> bool:
    """Whether it is of one state of floats, not of a batch."""
    return type(evaluation.satisfied) is list


def potential(task: Task, signals: Signals) -> Array:
    """The hierarchical potential Psi of a state or a batch of states."""
    return evaluate(task, signals).potential


def hard_potential(task: Task, evaluation: Evaluation) -> Array:
    """The hierarchical potential of an evaluated state without its comfort requirements."""
    groups = plan_of(task).hard_groups
    if is_single(evaluation):
        return 0.0 + _potential(groups, list(evaluation.scores.values()))
    return evaluation.potential * 0.0 + _potential(groups, evaluation.scores)


def margins(task: Task, signals: Signals) -> dict[str, Array]:
    """Label to margin, of a state or a batch of states."""
    return plan_of(task).by_label(evaluate(task, signals).margins)


def scores(task: Task, signals: Signals) -> dict[str, Array]:
    """Label to score r in [0, 1], of a state or a batch of states."""
    return plan_of(task).by_label(evaluate(task, signals).scores)


_evaluator = lru_cache(maxsize=256)(float_evaluator)


def evaluate_floats(plan: Plan, signals: Signals) -> Evaluation:
    """Evaluate one state of Python floats (vector signals: NumPy arrays); the fast path."""
    return _evaluator(plan)(signals)


def leaf_margins(plan: Plan, signals: Signals, xp: ModuleType) -> Array:
    """Margins of the comparisons of all rows, in a batch of states of one array namespace."""
    values = {name: as_floating(value, xp) for name, value in signals.items()}
    shape = _batch_shape(plan, values)
    like = next(iter(values.values()), None)
    raw = plan.array_margins(xp)(values)
    if not raw:
        return xp.zeros((0, *shape))
    return xp.stack([_broadcast(leaf, shape, like, xp) for leaf in raw])


def evaluate_arrays(plan: Plan, signals: Signals, xp: ModuleType) -> Evaluation:
    """Evaluate a batch of states in one array namespace."""
    leaves = leaf_margins(plan, signals, xp)
    if not plan.leaves:
        return Evaluation(leaves, leaves > 0.0, leaves, xp.zeros(leaves.shape[1:]))
    satisfied = leaf_satisfied(plan, leaves, xp)
    first = plan.safety_leaves
    lows = column(plan.soft_lows, leaves, xp)
    operations = array_operations(xp)
    negative = operations["min"](leaves[first:], 0.0)
    if -math.inf in plan.soft_lows:
        # A comparison that always holds has score 1 for every margin; -inf / -inf would be NaN.
        negative = xp.where(xp.isinf(lows) & xp.isinf(negative), xp.zeros_like(negative), negative)
    scores = operations["max"](1.0 - negative / lows, 0.0)
    if plan.compound:
        leaf_scores = [*leaves[:first], *scores]
        least, most = partial(reduce, xp.minimum), partial(reduce, xp.maximum)
        rows = plan.combine(leaf_scores, least, most)[plan.safety_count :]
        scores = xp.stack(rows) if rows else scores
        leaves = xp.stack(plan.combine(list(leaves), least, most))
        every, some = partial(reduce, both), partial(reduce, either)
        satisfied = xp.stack(plan.combine(list(satisfied), every, some))
    if plan.safety_count:
        safe, margins = satisfied[: plan.safety_count], leaves[: plan.safety_count]
        # NaN must not turn into a score.
        known = safe | (margins <= 0.0)
        binary = xp.where(known, xp.astype(safe, leaves.dtype), margins * math.nan)
        scores = xp.concat([binary, scores])
    return Evaluation(leaves, satisfied, scores, _potential(plan.groups, scores))


def _potential(groups: Sequence[Group], scores: Sequence[Array]) -> Array:
    total: Array = 0.0
    for group in groups:
        members = iter(group.members)
        subtotal = scores[next(members)]
        for row in members:
            subtotal = subtotal + scores[row]
        for row in group.above:
            subtotal = subtotal * scores[row]
        total = total + subtotal
    return total


def pick(plan: Plan, signals: Signals) -> dict[str, Array]:
    """The signals that a task reads.

    Raises:
        SignalError: One is missing.
    """
    try:
        return {name: signals[name] for name in plan.signals}
    except KeyError as error:
        missing = next(name for name in plan.signals if name not in signals)
        raise SignalError(
            f"signal '{missing}' is missing.{did_you_mean(missing, signals)} "
            f"The task reads {', '.join(plan.signals)}."
        ) from error


def _batch_shape(plan: Plan, values: Signals) -> tuple[int, ...]:
    vectors = {signal.name for signal in plan.task.signals if signal.length is not None}
    shapes = {
        tuple(value.shape[:-1] if name in vectors else value.shape)
        for name, value in values.items()
    }
    return np.broadcast_shapes(*shapes)


def _broadcast(leaf: Array, shape: tuple[int, ...], like: Array, xp: ModuleType) -> Array:
    if getattr(leaf, "shape", None) == shape:
        return leaf
    if isinstance(leaf, float) and like is not None:
        leaf = xp.full_like(like.reshape(-1)[0], leaf)
    return xp.broadcast_to(xp.asarray(leaf), shape)


def leaf_satisfied(plan: Plan, leaves: Array, xp: ModuleType) -> Array:
    """Whether each comparison holds, from their margins; one that is NaN does not."""
    if not plan.any_strict:
        return leaves >= 0.0
    if all(plan.strict):
        return leaves > 0.0
    strict = column(plan.strict, leaves, xp)
    return xp.where(strict > 0, leaves > 0.0, leaves >= 0.0)


def column(values: Sequence[float], leaves: Array, xp: ModuleType) -> Array:
    """Constants of rows, in the precision of `leaves`, which broadcast over its batch axes."""
    if xp is np:
        return _numpy_column(tuple(values), leaves.dtype, leaves.ndim)
    column = xp.asarray([float(value) for value in values], dtype=leaves.dtype)
    if hasattr(leaves, "device") and getattr(column, "device", None) != leaves.device:
        import array_api_compat

        compat: Any = array_api_compat
        column = compat.to_device(column, compat.device(leaves))
    return xp.reshape(column, (-1,) + (1,) * (leaves.ndim - 1))


@lru_cache(maxsize=1024)
def _numpy_column(values: tuple[float, ...], dtype: Any, ndim: int) -> Array:
    column: Array = cast(Any, np).array(values, dtype=dtype, ndmin=ndim).T
    column.flags.writeable = False
    return column
