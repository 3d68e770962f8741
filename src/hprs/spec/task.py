"""A task: signals, constants, definitions and requirements with their order, as frozen data.

`Task(...)` checks everything that can be known without an environment, so that a task that exists
is a task that can be evaluated. What it derives is in `task.analysis` and `task.order`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from hprs.errors import Position, SpecValidationError
from hprs.spec.expression import (
    BUILTIN_CONSTANTS,
    FUNCTIONS,
    Expression,
    ExpressionLike,
    Name,
    Operand,
    Predicate,
    as_expression,
    position_field,
)
from hprs.spec.interval import Interval

if TYPE_CHECKING:
    from hprs.spec.analysis import Analysis
    from hprs.spec.order import Order

Kind: TypeAlias = Literal["ensure", "achieve", "conquer", "encourage"]
RequirementClass: TypeAlias = Literal["safety", "target", "comfort"]

CLASSES: Mapping[Kind, RequirementClass] = {
    "ensure": "safety",
    "achieve": "target",
    "conquer": "target",
    "encourage": "comfort",
}
"""The paper's three classes (section "Requirements-Specification Language")."""

KEYWORDS = frozenset(
    {"signal", "const", "let", "in", "initially", "prefer", "over", "and", "or", "not", *CLASSES}
)
ROOTS = ("obs", "action", "last_action", "info")
"""What a source may read."""

ENV_REWARD = "env_reward"
"""Reserved name under which the environment's own reward travels among the signals."""

MAX_REQUIREMENTS = 500
"""Most requirements, and most preferences; the order grows with their square."""

RESERVED = KEYWORDS | frozenset(BUILTIN_CONSTANTS) | frozenset(FUNCTIONS) | {ENV_REWARD}


@dataclass(frozen=True)
class Source:
    """Where a signal is read: a root, a path of keys into it, and an index on the last axis.

    `obs.pose[0:2]` is `Source("obs", ("pose",), (0, 2))`, `action[1]` is `Source("action", (), 1)`.
    """

    root: str
    keys: tuple[str, ...] = ()
    index: int | tuple[int | None, int | None] | None = None
    position: Position | None = position_field()

    def __post_init__(self) -> None:
        """Check the root, and that only dictionaries are given keys."""
        if self.root not in ROOTS:
            raise SpecValidationError(
                f"a source reads {', '.join(ROOTS)}, not '{self.root}'.", self.position
            )
        for key in self.keys:
            if not (key.isidentifier() and key.isascii()):
                raise SpecValidationError(
                    f"the key '{key}' of a source is not a name; read it with a function instead.",
                    self.position,
                )
        ends = self.index if isinstance(self.index, tuple) else (self.index,)
        if any(end is not None and abs(end) > 1_000_000 for end in ends):
            raise SpecValidationError("an index goes from -1000000 to 1000000.", self.position)
        if self.root == "info" and not self.keys:
            raise SpecValidationError(
                "info is a dictionary: name its entry, as in info.progress.", self.position
            )
        if self.root in ("action", "last_action") and self.keys:
            raise SpecValidationError(
                f"{self.root} has no entries: read it as {self.root}[0].", self.position
            )

    def __str__(self) -> str:
        """The source as written in a task."""
        path = ".".join((self.root, *self.keys))
        if self.index is None:
            return path
        if isinstance(self.index, int):
            return f"{path}[{self.index}]"
        start, stop = self.index
        return f"{path}[{'' if start is None else start}:{'' if stop is None else stop}]"


@dataclass(frozen=True)
class Signal(Operand):
    """A named real quantity with its range; a vector of `length` components shares one range.

    Args:
        name: Its name in requirements.
        low: Smallest value; a constant expression, -inf allowed.
        high: Largest value; a constant expression, inf allowed.
        source: Where wrappers read it; None: the environment supplies `info["signals"][name]`.
        length: Number of components, None for a scalar.
        initially: Value at reset where the source is missing; a constant expression.
        unit: A label, never used in arithmetic.
    """

    name: str
    low: Expression
    high: Expression
    source: Source | None = None
    length: int | None = None
    initially: Expression | None = None
    unit: str = ""
    position: Position | None = position_field()

    def __init__(
        self,
        name: str,
        low: ExpressionLike,
        high: ExpressionLike,
        *,
        source: Source | None = None,
        length: int | None = None,
        initially: ExpressionLike | None = None,
        unit: str = "",
        position: Position | None = None,
    ) -> None:
        values = {
            "name": name,
            "low": as_expression(low),
            "high": as_expression(high),
            "source": source,
            "length": length,
            "initially": None if initially is None else as_expression(initially),
            "unit": unit,
            "position": position,
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)
        if length is not None and not 1 <= length <= 1_000_000:
            raise SpecValidationError(
                f"signal '{name}' needs a length from 1 to 1000000, got {length}.", position
            )
        if any(character == '"' or not character.isprintable() for character in unit):
            raise SpecValidationError(
                f"the unit of signal '{name}' may hold neither quotes nor control characters.",
                position,
            )

    def expression(self) -> Expression:
        """A reference to this signal."""
        return Name(self.name)


@dataclass(frozen=True)
class Constant(Operand):
    """A named number: `const NAME = EXPR`."""

    name: str
    value: Expression
    position: Position | None = position_field()

    def __post_init__(self) -> None:
        """Accept plain numbers."""
        object.__setattr__(self, "value", as_expression(self.value))

    def expression(self) -> Expression:
        """A reference to this constant."""
        return Name(self.name)


@dataclass(frozen=True)
class Definition(Operand):
    """A named expression: `let NAME = EXPR [in [LOW, HIGH]]`.

    The range tightens what interval arithmetic derives.
    """

    name: str
    value: Expression
    low: Expression | None = None
    high: Expression | None = None
    position: Position | None = position_field()

    def __post_init__(self) -> None:
        """Accept plain numbers in the range."""
        object.__setattr__(self, "value", as_expression(self.value))
        if (self.low is None) != (self.high is None):
            raise SpecValidationError(f"the range of '{self.name}' needs both ends.", self.position)
        if self.low is not None and self.high is not None:
            object.__setattr__(self, "low", as_expression(self.low))
            object.__setattr__(self, "high", as_expression(self.high))

    def expression(self) -> Expression:
        """A reference to this definition."""
        return Name(self.name)


@dataclass(frozen=True)
class Requirement:
    """One labelled requirement: `KIND LABEL: PREDICATE`."""

    kind: Kind
    label: str
    predicate: Predicate
    position: Position | None = position_field()

    def __post_init__(self) -> None:
        """Check the kind."""
        if self.kind not in CLASSES:
            raise SpecValidationError(
                f"a requirement is one of {', '.join(CLASSES)}, not '{self.kind}'.", self.position
            )

    @property
    def requirement_class(self) -> RequirementClass:
        """Its class: safety, target or comfort."""
        return CLASSES[self.kind]


@dataclass(frozen=True)
class Preference:
    """`prefer HIGHER over LOWER`: an added pair of the strict order of importance."""

    higher: str
    lower: str
    position: Position | None = position_field()


@dataclass(frozen=True)
class Task:
    """What a robot must do.

    A name may be used only after the declaration it refers to, in the order constants, signals,
    definitions, requirements.

    Raises:
        SpecValidationError: A name is unknown, reserved or declared twice; a range, an operation, a
            requirement or the order cannot be meant. The message says which and what to do.
    """

    signals: tuple[Signal, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    constants: tuple[Constant, ...] = ()
    definitions: tuple[Definition, ...] = ()
    preferences: tuple[Preference, ...] = ()

    def __post_init__(self) -> None:
        """Freeze sequences into tuples and check the whole task."""
        for name in ("signals", "requirements", "constants", "definitions", "preferences"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if len(self.requirements) > MAX_REQUIREMENTS:
            raise SpecValidationError(
                f"a task may have {MAX_REQUIREMENTS} requirements, got {len(self.requirements)}.",
                self.requirements[MAX_REQUIREMENTS].position,
            )
        if len(self.preferences) > MAX_REQUIREMENTS:
            raise SpecValidationError(
                f"a task may have {MAX_REQUIREMENTS} preferences, got {len(self.preferences)}.",
                self.preferences[MAX_REQUIREMENTS].position,
            )
        _ = (self.analysis, self.order)

    def __reduce__(self) -> tuple[type[Task], tuple[Any, ...]]:
        """Pickle the fields alone: a cached hash means nothing in another process."""
        return Task, (
            self.signals,
            self.requirements,
            self.constants,
            self.definitions,
            self.preferences,
        )

    def __hash__(self) -> int:
        """Structural hash, computed once: tasks are keys of caches."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(
            (
                self.signals,
                self.requirements,
                self.constants,
                self.definitions,
                self.preferences,
            )
        )

    @cached_property
    def analysis(self) -> Analysis:
        """Shapes, ranges, bounds and warnings."""
        from hprs.spec.analysis import analyse

        return analyse(self)

    @cached_property
    def order(self) -> Order:
        """The strict partial order of importance."""
        from hprs.spec.order import order_of

        return order_of(self)

    @property
    def labels(self) -> tuple[str, ...]:
        """The requirements' labels in the order of the text."""
        return tuple(requirement.label for requirement in self.requirements)

    @property
    def target(self) -> Requirement | None:
        """The target requirement, if there is one."""
        return next((r for r in self.requirements if r.requirement_class == "target"), None)

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Label to (l, u), the smallest and largest margin that the signals' ranges allow."""
        return {label: (bound.low, bound.high) for label, bound in self.analysis.bounds.items()}

    def margins(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Label to margin f in a state or a batch of states; positive where satisfied.

        Args:
            signals: Name to float, or to NumPy, JAX or PyTorch arrays of any batch shape.
        """
        from hprs.semantics.evaluation import margins

        return margins(self, signals)

    def potential(self, signals: Mapping[str, Any]) -> Any:
        """The hierarchical potential Psi of a state or a batch of states; see `margins`."""
        from hprs.semantics.evaluation import potential

        return potential(self, signals)

    @property
    def ranges(self) -> Mapping[str, Interval]:
        """Signal name to its range."""
        return self.analysis.ranges

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is legal and probably not meant."""
        return self.analysis.remarks


@dataclass(frozen=True)
class Remark:
    """A remark on a task that is legal and probably not meant."""

    message: str
    position: Position | None = position_field()
