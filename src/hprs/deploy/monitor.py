"""Follows a task's requirements live, out of the task's JSON, where hprs is not installed.

It says of every state what `hprs.semantics` says of it; a test compares the two on random tasks.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hprs.errors import BundleError

Values = Mapping[str, Any]

SAFETY = "ensure"
"""The kind of the requirements that a stop is made of."""

_BUILT_IN = {"pi": math.pi, "deg": math.pi / 180.0, "inf": math.inf}
_ARITHMETIC: Dict[str, Callable[..., Any]] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": np.power,
}
_PLAIN: Dict[str, Callable[..., Any]] = {
    "abs": np.abs,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "atan2": np.arctan2,
    "hypot": np.hypot,
    "sign": np.sign,
    "clip": lambda x, low, high: np.minimum(np.maximum(x, low), high),
}
_REDUCTIONS: Dict[str, Callable[[Any], Any]] = {
    "min": np.min,
    "max": np.max,
    "sum": np.sum,
    "mean": np.mean,
    "norm": lambda x: np.sqrt(np.sum(x * x)),
}
_OF_SEVERAL: Dict[str, Callable[[Sequence[Any]], Any]] = {
    "min": lambda parts: reduce(np.minimum, parts),
    "max": lambda parts: reduce(np.maximum, parts),
    "sum": lambda parts: reduce(np.add, parts),
    "mean": lambda parts: reduce(np.add, parts) * (1.0 / len(parts)),
    "norm": lambda parts: np.sqrt(reduce(np.add, [part * part for part in parts])),
}


class Verdict(NamedTuple):
    """On one requirement in one state."""

    label: str
    kind: str
    margin: float
    """NaN where it is unknown."""
    satisfied: Optional[bool]
    """None where a signal that it needs is unknown."""


class Monitor:
    """A task's requirements, ready to be evaluated.

    Args:
        task: As JSON, of a bundle.

    Raises:
        BundleError: It is no such task.
    """

    def __init__(self, task: Mapping[str, Any]) -> None:
        try:
            self.signals: Dict[str, Optional[int]] = {
                one["name"]: one["length"] for one in task["signals"]
            }
            self._names = [(one["name"], _compiled(one["value"])) for one in task["constants"]]
            self._names += [(one["name"], _compiled(one["value"])) for one in task["definitions"]]
            self._rows = [
                (one["label"], one["kind"], _predicate(one["predicate"]))
                for one in task["requirements"]
            ]
        except (KeyError, TypeError, IndexError, ValueError) as error:
            raise BundleError("its task cannot be read: {!r}.".format(error)) from None

    @property
    def labels(self) -> List[str]:
        """Of the requirements."""
        return [label for label, _, _ in self._rows]

    def __call__(self, signals: Mapping[str, Any]) -> List[Verdict]:
        """A verdict on every requirement in one state.

        Args:
            signals: Name to value; what is not there, or NaN, is unknown.
        """
        values: Dict[str, Any] = dict(_BUILT_IN)
        for name, length in self.signals.items():
            given = signals.get(name)
            unknown = math.nan if length is None else np.full(length, math.nan)
            values[name] = np.float64(unknown if given is None else given)
        with np.errstate(all="ignore"):
            for name, function in self._names:
                values[name] = function(values)
            return [_verdict(label, kind, row(values)) for label, kind, row in self._rows]


def violated_safety(verdicts: Sequence[Verdict]) -> List[str]:
    """Labels of the safety requirements that are violated; unknown ones are not."""
    return [one.label for one in verdicts if one.kind == SAFETY and one.satisfied is False]


def _verdict(label: str, kind: str, found: Tuple[Any, Optional[bool]]) -> Verdict:
    margin, holds = found
    return Verdict(label, kind, float(margin), holds)


def _compiled(node: Any) -> Callable[[Values], Any]:
    """A function of an expression's value."""
    if isinstance(node, str):
        return lambda values: values[node]
    if isinstance(node, (int, float)):
        number = np.float64(node)
        return lambda values: number
    name, parts = node[0], [_compiled(part) for part in node[1:]]
    if name == "-" and len(parts) == 1:
        (only,) = parts
        return lambda values: -only(values)
    if name in _ARITHMETIC:
        operation, (left, right) = _ARITHMETIC[name], parts
        return lambda values: operation(left(values), right(values))
    if name in _REDUCTIONS:
        return _reduction(name, parts)
    function = _PLAIN[name]
    return lambda values: function(*[part(values) for part in parts])


def _reduction(name: str, parts: Sequence[Callable[[Values], Any]]) -> Callable[[Values], Any]:
    """Of one vector, or over several numbers."""
    whole, several = _REDUCTIONS[name], _OF_SEVERAL[name]

    def apply(values: Values) -> Any:
        found = [part(values) for part in parts]
        return whole(found[0]) if len(found) == 1 else several(found)

    return apply


def _predicate(node: Any) -> Callable[[Values], Tuple[Any, Optional[bool]]]:
    """A function of a predicate's margin, and whether it holds; None where that is unknown."""
    name, rest = node[0], node[1:]
    if name in ("and", "or"):
        parts = [_predicate(part) for part in rest]
        extremum = np.minimum if name == "and" else np.maximum
        # One part that fails decides "and", one that holds decides "or", whatever is unknown.
        decisive = name == "or"

        def connective(values: Values) -> Tuple[Any, Optional[bool]]:
            margins, holds = zip(*[part(values) for part in parts])
            unknown = None if None in holds else not decisive
            return reduce(extremum, margins), decisive if decisive in holds else unknown

        return connective
    if name not in ("<=", "<", ">=", ">"):
        raise ValueError("{!r} is no relation".format(name))
    left, right = map(_compiled, rest)
    low, high = (left, right) if name in ("<=", "<") else (right, left)
    strict = name in ("<", ">")

    def comparison(values: Values) -> Tuple[Any, Optional[bool]]:
        margin = high(values) - low(values)
        holds = margin > 0 if strict else margin >= 0
        return margin, None if math.isnan(margin) else bool(holds)

    return comparison
