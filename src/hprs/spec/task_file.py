"""From the bytes of a task file to its text: size, encoding, ends of lines."""

from __future__ import annotations

import codecs
import os
from pathlib import Path

from hprs.errors import Position, SpecError, SpecSyntaxError, SpecTypeError
from hprs.spec.misuse import shown

MAX_BYTES = 1_000_000
"""Largest text, in bytes of UTF-8."""


def read_text(path: str | os.PathLike[str]) -> str:
    """The text of a file.

    Raises:
        SpecError: The file cannot be read, is too large or is not UTF-8.
    """
    name = os.fspath(path)
    try:
        with Path(path).open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise SpecError(f"this task cannot be read: {reason}.", path=name) from None
    return _decode(data, name)


def normalised(text: str) -> str:
    """The text without byte order mark, its lines ended by newlines.

    Raises:
        SpecError: It is no text, too large, or holds a NUL character.
    """
    if not isinstance(text, str):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise SpecTypeError(
            f"the text of a task is needed here, got {shown(text)}. "
            "A file is read by hprs.load_task(path)."
        )
    if len(text.encode("utf-8", "surrogatepass")) > MAX_BYTES:
        raise SpecError(_TOO_LARGE)
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    before, nul, _ = text.partition("\0")
    if nul:
        column = len(before) - before.rfind("\n")
        raise SpecSyntaxError(
            "this is a NUL character; the file is damaged or not a text.",
            Position(before.count("\n") + 1, column),
            text=text,
        )
    return text


def _decode(data: bytes, path: str) -> str:
    if len(data) > MAX_BYTES:
        raise SpecError(_TOO_LARGE, path=path)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise SpecError("this file is encoded as UTF-16. Save it as UTF-8.", path=path)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise SpecError(
            f"line {line} holds the byte 0x{data[error.start]:02X}, which is not UTF-8. "
            "Save the file as UTF-8.",
            path=path,
        ) from None


_TOO_LARGE = f"a task may have {MAX_BYTES} bytes, and this one has more."
