"""Data in an HTML page, which nothing in it can leave."""

from __future__ import annotations

import html
import json
import re
from typing import Any


def embedded(value: Any) -> str:
    """A value as JSON that can stand in a script element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    # Neither a closing tag nor a comment can appear without these.
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def filled(template: str, title: str, content: Any) -> str:
    """A page: its template's `{{title}}` and `{{data}}` replaced."""
    parts = {"title": html.escape(title), "data": embedded(content)}
    # In one pass, so that what is filled in is not searched.
    return re.sub(r"\{\{(title|data)\}\}", lambda place: parts[place[1]], template)
