"""A task as plain JSON types, so that it can be stored and read back without the parser.

An expression is a number, a name, `["-", e]`, `[operator, left, right]` or `[function, e, ...]`; a
predicate is `[relation, left, right]`, `["and", p, ...]` or `["or", p, ...]`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, TypeVar, cast

from hprs.errors import SpecError, SpecValidationError, did_you_mean
from hprs.spec.expression import (
    MAX_DEPTH,
    And,
    Binary,
    BinaryOperator,
    Call,
    Comparison,
    Expression,
    Name,
    Negate,
    Number,
    Or,
    Predicate,
    Relation,
)
from hprs.spec.task import (
    Constant,
    Definition,
    Preference,
    Requirement,
    Signal,
    Source,
    Task,
)
from hprs.spec.vocabulary import CLASSES, FUNCTIONS, Kind

FORMAT = 1
"""Version of the format; a reader refuses any other."""

Json: TypeAlias = "bool | int | float | str | list[Json] | dict[str, Json] | None"

_T = TypeVar("_T")
_KINDS: Mapping[str, Kind] = {kind: kind for kind in CLASSES}
_OPERATORS: Mapping[str, BinaryOperator] = {"+": "+", "-": "-", "*": "*", "/": "/", "**": "**"}
_RELATIONS: Mapping[str, Relation] = {"<=": "<=", "<": "<", ">=": ">=", ">": ">"}
_CONNECTIVES: Mapping[str, type[And] | type[Or]] = {"and": And, "or": Or}


def task_to_json(task: Task) -> dict[str, Json]:
    """The task as JSON types; comments and positions are not part of a task."""
    return {
        "format": FORMAT,
        "constants": [{"name": c.name, "value": _write(c.value)} for c in task.constants],
        "signals": [_signal(signal) for signal in task.signals],
        "definitions": [_definition(definition) for definition in task.definitions],
        "requirements": [
            {"kind": r.kind, "label": r.label, "predicate": _write(r.predicate)}
            for r in task.requirements
        ],
        "preferences": [{"higher": p.higher, "lower": p.lower} for p in task.preferences],
    }


def task_from_json(data: object) -> Task:
    """The task that `task_to_json` wrote.

    Raises:
        SpecError: The data are not such a task; the message names the place.
    """
    root = _Place(data, "task")
    entries = root.entries(
        "format", "constants", "signals", "definitions", "requirements", "preferences"
    )
    version = entries["format"].value
    if version != FORMAT or isinstance(version, bool):
        raise SpecError(
            f"this task has JSON format {version!r}, and this version of hprs reads {FORMAT}."
        )
    return Task(
        constants=_each(entries["constants"], _read_constant),
        signals=_each(entries["signals"], _read_signal),
        definitions=_each(entries["definitions"], _read_definition),
        requirements=_each(entries["requirements"], _read_requirement),
        preferences=_each(entries["preferences"], _read_preference),
    )


def _signal(signal: Signal) -> dict[str, Json]:
    return {
        "name": signal.name,
        "low": _write(signal.low),
        "high": _write(signal.high),
        "source": None if signal.source is None else _source(signal.source),
        "length": signal.length,
        "initially": None if signal.initially is None else _write(signal.initially),
        "unit": signal.unit,
    }


def _source(source: Source) -> dict[str, Json]:
    index = list(source.index) if isinstance(source.index, tuple) else source.index
    return {"root": source.root, "keys": list(source.keys), "index": cast(Json, index)}


def _definition(definition: Definition) -> dict[str, Json]:
    return {
        "name": definition.name,
        "value": _write(definition.value),
        "low": None if definition.low is None else _write(definition.low),
        "high": None if definition.high is None else _write(definition.high),
    }


def _write(node: Expression | Predicate) -> Json:
    match node:
        case Number(value):
            exact = float(value)
            return int(exact) if exact.is_integer() and exact < 1e16 else exact
        case Name(name):
            return name
        case Negate(operand):
            return ["-", _write(operand)]
        case Binary(operator, left, right) | Comparison(left, operator, right):
            return [operator, _write(left), _write(right)]
        case Call(function, arguments):
            return [function, *map(_write, arguments)]
        case And(parts):
            return ["and", *map(_write, parts)]
        case _:
            return ["or", *map(_write, node.parts)]


@dataclass(frozen=True)
class _Place:
    """A part of the data and the path that leads to it."""

    value: object
    path: str
    depth: int = 0

    def wrong(self, wanted: str) -> SpecError:
        """The error for a part that is not what is wanted."""
        return SpecError(f"{self.path} must be {wanted}, got {_shown(self.value)}.")

    def entries(self, *keys: str) -> dict[str, _Place]:
        """The entries of an object that has exactly these keys."""
        value = _mapping(self.value)
        if value is None:
            raise self.wrong("an object")
        for key in value:
            if key not in keys:
                raise SpecError(
                    f"{self.path} has the unknown key {_shown(key)}."
                    f"{did_you_mean(str(key)[:100], keys)}"
                )
        for key in keys:
            if key not in value:
                raise SpecError(f"{self.path} lacks the key '{key}'.")
        return {key: _Place(value[key], f"{self.path}.{key}") for key in keys}

    def items(self) -> list[_Place]:
        """The items of an array."""
        value = _sequence(self.value)
        if value is None:
            raise self.wrong("an array")
        if self.depth > MAX_DEPTH:
            raise SpecError(f"{self.path[:100]}... is nested deeper than {MAX_DEPTH} levels.")
        return [
            _Place(item, f"{self.path}[{index}]", self.depth + 1)
            for index, item in enumerate(value)
        ]

    def text(self) -> str:
        """A string."""
        if not isinstance(self.value, str):
            raise self.wrong("a string")
        return self.value

    def whole(self) -> int:
        """A whole number."""
        if not isinstance(self.value, int) or isinstance(self.value, bool):
            raise self.wrong("a whole number")
        if abs(self.value) >= 10**9:
            raise self.wrong("a whole number below 10 ** 9")
        return self.value

    def choice(self, options: Mapping[str, _T]) -> _T | None:
        """The option of this name, or None."""
        return options.get(self.value) if isinstance(self.value, str) else None

    def optional(self, read: Callable[[_Place], _T]) -> _T | None:
        """What `read` reads, or None for null."""
        return None if self.value is None else read(self)


def _mapping(value: object) -> Mapping[object, object] | None:
    return cast("Mapping[object, object]", value) if isinstance(value, Mapping) else None


def _sequence(value: object) -> Sequence[object] | None:
    return cast("Sequence[object]", value) if isinstance(value, list | tuple) else None


def _shown(value: object) -> str:
    if _mapping(value) is not None:
        return "an object"
    if _sequence(value) is not None:
        return "an array"
    if isinstance(value, int) and abs(value) >= 10**50:
        return "a huge number"
    text = repr(value)
    return text if len(text) <= 50 else f"{text[:50]}..."


def _each(place: _Place, read: Callable[[_Place], _T]) -> tuple[_T, ...]:
    return tuple(read(item) for item in place.items())


def _read_constant(place: _Place) -> Constant:
    entries = place.entries("name", "value")
    return Constant(entries["name"].text(), _expression(entries["value"]))


def _read_signal(place: _Place) -> Signal:
    entries = place.entries("name", "low", "high", "source", "length", "initially", "unit")
    return Signal(
        entries["name"].text(),
        _expression(entries["low"]),
        _expression(entries["high"]),
        source=entries["source"].optional(_read_source),
        length=entries["length"].optional(_Place.whole),
        initially=entries["initially"].optional(_expression),
        unit=entries["unit"].text(),
    )


def _read_source(place: _Place) -> Source:
    entries = place.entries("root", "keys", "index")
    return Source(
        entries["root"].text(),
        _each(entries["keys"], _Place.text),
        entries["index"].optional(_read_index),
    )


def _read_index(place: _Place) -> int | tuple[int | None, int | None]:
    if _sequence(place.value) is None:
        return place.whole()
    ends = place.items()
    if len(ends) != 2:
        raise place.wrong("a whole number or an array of two")
    return (ends[0].optional(_Place.whole), ends[1].optional(_Place.whole))


def _read_definition(place: _Place) -> Definition:
    entries = place.entries("name", "value", "low", "high")
    return Definition(
        entries["name"].text(),
        _expression(entries["value"]),
        entries["low"].optional(_expression),
        entries["high"].optional(_expression),
    )


def _read_requirement(place: _Place) -> Requirement:
    entries = place.entries("kind", "label", "predicate")
    kind = entries["kind"].choice(_KINDS)
    if kind is None:
        raise entries["kind"].wrong(f"one of {', '.join(CLASSES)}")
    return Requirement(kind, entries["label"].text(), _predicate(entries["predicate"]))


def _read_preference(place: _Place) -> Preference:
    entries = place.entries("higher", "lower")
    return Preference(entries["higher"].text(), entries["lower"].text())


def _expression(place: _Place) -> Expression:
    value = place.value
    if isinstance(value, str):
        return Name(value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _read_number(place, value)
    if _sequence(value) is None:
        raise place.wrong("a number, a name or an array")
    head, *rest = place.items() or [_Place(None, place.path)]
    operator = head.choice(_OPERATORS)
    if operator == "-" and len(rest) == 1:
        return Negate(_expression(rest[0]))
    if operator is not None and len(rest) == 2:
        return Binary(operator, _expression(rest[0]), _expression(rest[1]))
    if isinstance(head.value, str) and head.value in FUNCTIONS:
        return Call(head.value, tuple(map(_expression, rest)))
    raise SpecError(f"{place.path} must be an operator or a function with its operands.")


def _read_number(place: _Place, value: float) -> Number:
    try:
        return Number(float(value))
    except (OverflowError, SpecValidationError):
        raise place.wrong("a finite number that is not negative") from None


def _predicate(place: _Place) -> Predicate:
    head, *rest = place.items() or [_Place(None, place.path)]
    relation = head.choice(_RELATIONS)
    if relation is not None and len(rest) == 2:
        return Comparison(_expression(rest[0]), relation, _expression(rest[1]))
    connective = head.choice(_CONNECTIVES)
    if connective is not None:
        return connective(tuple(map(_predicate, rest)))
    raise SpecError(
        f"{place.path} must be a relation with two sides, or 'and' or 'or' with its parts."
    )
