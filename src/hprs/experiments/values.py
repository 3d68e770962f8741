"""Reads the values of a grid's file, with errors that say where and what."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hprs.errors import GridError, did_you_mean


def check_keys(table: Mapping[str, Any], known: Mapping[str, Any], place: str) -> None:
    """See that a table holds known keys only.

    Raises:
        GridError: It holds another.
    """
    for key in table:
        if key not in known:
            hint = did_you_mean(key, known) or f" It may hold {', '.join(known)}."
            raise GridError(f"{place}: unknown key '{key}'.{hint}")


def strings(value: Any, place: str) -> tuple[str, ...]:
    """One name or a list of names.

    Raises:
        GridError: It is neither, or the list is empty.
    """
    found = [value] if isinstance(value, str) else value
    if not isinstance(found, list) or not found or not all(isinstance(x, str) for x in found):
        raise GridError(f"{place} must be a name or a list of names, got {value!r}.")
    return tuple(found)


def seeds(value: Any, place: str) -> tuple[int, ...]:
    """A number of seeds, from 0 on, or a list of seeds.

    Raises:
        GridError: It is neither.
    """
    found = list(range(value)) if type(value) is int else value
    listed = isinstance(found, list) and all(type(x) is int and x >= 0 for x in found)
    if not listed or not found or len(set(found)) != len(found):
        raise GridError(
            f"{place} must be how many, from 1 on, or a list of different ones, got {value!r}."
        )
    return tuple(found)


def count(value: Any, place: str) -> int:
    """A whole number from 1 on.

    Raises:
        GridError: It is another value.
    """
    if type(value) is not int or value < 1:
        raise GridError(f"{place} must be a whole number from 1 on, got {value!r}.")
    return value


def table(value: Any, place: str) -> dict[str, Any]:
    """A table.

    Raises:
        GridError: It is another value.
    """
    if not isinstance(value, dict):
        raise GridError(f"{place} must be a table, as in {{ gamma = 0.99 }}, got {value!r}.")
    return dict(value)


def string(value: Any, place: str) -> str:
    """A text.

    Raises:
        GridError: It is another value.
    """
    if not isinstance(value, str):
        raise GridError(f"{place} must be a text in quotes, got {value!r}.")
    return value
