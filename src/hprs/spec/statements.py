"""The statements of a task, as frozen data: what each line of its text says."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

from hprs.errors import Position, SpecTypeError, SpecValidationError
from hprs.spec.expression import (
    And,
    Comparison,
    Expression,
    ExpressionLike,
    Name,
    Operand,
    Or,
    Predicate,
    as_expression,
    position_field,
)
from hprs.spec.misuse import not_a_predicate, shown
from hprs.spec.vocabulary import CLASSES, ROOTS, Kind, RequirementClass


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
        """Check root, keys and index, and that only dictionaries are given keys."""
        if self.root not in ROOTS:
            raise SpecValidationError(
                f"a source reads {', '.join(ROOTS)}, not '{self.root}'.", self.position
            )
        self._set_keys_and_index()
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

    def _set_keys_and_index(self) -> None:
        """Keys as a tuple of texts, indices as Python's integers."""
        given: object = self.keys
        keys = tuple(self.keys) if isinstance(given, tuple | list) else (None,)  # pyright: ignore[reportUnnecessaryIsInstance]
        if not all(isinstance(key, str) for key in keys):
            raise SpecTypeError(
                f'the keys of a source are written ("pose", "x"), got {shown(given)}.',
                self.position,
            )
        ends = self.index if isinstance(self.index, tuple) else (self.index, None)
        if len(ends) != 2 or not all(map(_is_whole_or_none, ends)):
            raise SpecTypeError(
                "the index of a source is written 0, or (0, 2) for the slice 0:2, "
                f"got {shown(self.index)}.",
                self.position,
            )
        first, last = (None if end is None else int(end) for end in ends)
        object.__setattr__(self, "keys", keys)
        object.__setattr__(self, "index", (first, last) if isinstance(self.index, tuple) else first)

    def __str__(self) -> str:
        """The source as written in a task."""
        path = ".".join((self.root, *self.keys))
        if self.index is None:
            return path
        if isinstance(self.index, int):
            return f"{path}[{self.index}]"
        start, stop = self.index
        return f"{path}[{'' if start is None else start}:{'' if stop is None else stop}]"


def _is_whole_or_none(end: object) -> bool:
    return end is None or (not isinstance(end, bool) and isinstance(end, Integral))


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
            "length": int(length) if isinstance(length, Integral) else length,
            "initially": None if initially is None else as_expression(initially),
            "unit": unit,
            "position": position,
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)
        for what, value, kind, example in (
            ("source", source, Source | None, 'Source("obs", (), 0)'),
            ("length", length, Integral | None, "3"),
            ("unit", unit, str, '"m"'),
        ):
            if not isinstance(value, kind) or isinstance(value, bool):
                raise SpecTypeError(
                    f"the {what} of signal '{name}' is written {example}, got {shown(value)}.",
                    position,
                )
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
        """Check kind and predicate."""
        if self.kind not in tuple(CLASSES):
            raise SpecValidationError(
                f"a requirement is one of {', '.join(CLASSES)}, not '{self.kind}'.", self.position
            )
        if not isinstance(self.predicate, Comparison | And | Or):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise not_a_predicate(f"requirement '{self.label}' needs", self.predicate)

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

    def __post_init__(self) -> None:
        """Check that it names labels."""
        for label in (self.higher, self.lower):
            if not isinstance(label, str):  # pyright: ignore[reportUnnecessaryIsInstance]
                raise SpecTypeError(
                    f'a preference names two labels, as in Preference("near", "slow"), '
                    f"got {shown(label)}.",
                    self.position,
                )
