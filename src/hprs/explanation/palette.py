"""Colours that people with any kind of colour vision can tell apart (Okabe and Ito; Tol).

They are legible on white and on black. Nothing is told by colour alone.
"""

from __future__ import annotations

from collections.abc import Sequence

from hprs.explanation.explanation import Part

_CLASSES = {
    "safety": ("#0072b2", "#56b4e9", "#5e6fb8", "#88ccee"),
    "target": ("#009e73",),
    "comfort": ("#cc79a7", "#e6b93c", "#9d6fc4", "#999933", "#b5a08a", "#d8a3c8"),
}
VIOLATED = "#d55e00"
"""Where a safety or comfort requirement does not hold."""
UNMET = "#8a8f98"
"""Where a target does not hold."""


def colours(parts: Sequence[Part]) -> list[str]:
    """One colour a requirement; those of a class are related, and repeat when there are many."""
    seen = dict.fromkeys(_CLASSES, 0)
    found: list[str] = []
    for part in parts:
        kind = part.requirement.requirement_class
        shades = _CLASSES[kind]
        found.append(shades[seen[kind] % len(shades)])
        seen[kind] += 1
    return found


def failing(part: Part) -> str:
    """The colour of not holding."""
    return UNMET if part.is_target else VIOLATED
