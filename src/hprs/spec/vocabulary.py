"""The words of the task language, and what they stand for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, TypeAlias

Kind: TypeAlias = Literal["ensure", "achieve", "conquer", "encourage"]
RequirementClass: TypeAlias = Literal["safety", "target", "comfort"]

CLASSES: Mapping[Kind, RequirementClass] = {
    "ensure": "safety",
    "achieve": "target",
    "conquer": "target",
    "encourage": "comfort",
}
"""The paper's three classes (section "Requirements-Specification Language")."""

STATEMENTS = ("signal", "const", "let", *CLASSES, "prefer")
"""The words that start a statement."""

KEYWORDS = frozenset({*STATEMENTS, "in", "initially", "over", "and", "or", "not"})
ROOTS = ("obs", "action", "last_action", "info")
"""What a source may read."""

ENV_REWARD = "env_reward"
"""Reserved name under which the environment's own reward travels among the signals."""

BUILTIN_CONSTANTS: Mapping[str, float] = MappingProxyType(
    {"pi": math.pi, "deg": math.pi / 180.0, "inf": math.inf}
)
"""Constants that every task knows; `inf` may stand only at the end of a range."""

FUNCTIONS: Mapping[str, tuple[int, int | None]] = MappingProxyType(
    {
        "abs": (1, 1),
        "min": (1, None),
        "max": (1, None),
        "sum": (1, None),
        "mean": (1, None),
        "norm": (1, None),
        "clip": (3, 3),
        "sqrt": (1, 1),
        "exp": (1, 1),
        "log": (1, 1),
        "sin": (1, 1),
        "cos": (1, 1),
        "tan": (1, 1),
        "atan2": (2, 2),
        "hypot": (2, 2),
        "sign": (1, 1),
    }
)
"""Function names with their smallest and largest number of arguments."""

REDUCTIONS = frozenset({"min", "max", "sum", "mean", "norm"})
"""Functions that reduce one vector, or compare several scalars."""

RESERVED = KEYWORDS | frozenset(BUILTIN_CONSTANTS) | frozenset(FUNCTIONS) | {ENV_REWARD}
"""What no signal, constant, definition or requirement may be called."""
