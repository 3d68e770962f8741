"""Reads TOML, with the standard library where that can."""

from __future__ import annotations

import sys
from typing import Any

from hprs.errors import UsageError


def parse_toml(text: str, path: str) -> dict[str, Any]:
    """The tables of a text.

    Args:
        text: The text.
        path: The file's name, for messages.

    Raises:
        UsageError: It is no TOML.
    """
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib  # pyright: ignore[reportMissingImports]
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path}: it is no TOML: {error}") from None
