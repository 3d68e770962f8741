"""Docstrings fence text as Markdown does; Sphinx reads reStructuredText."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

BEFORE_NAPOLEON = 400
FENCE = "```"


def to_blocks(
    _app: Sphinx, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Make every fence of a docstring a literal block, in place."""
    fenced = False
    blocks: list[str] = []
    for line in lines:
        if line.strip().startswith(FENCE):
            blocks += [""] if fenced else ["", ".. code-block:: text", ""]
            fenced = not fenced
        else:
            blocks.append(f"   {line}" if fenced and line else line)
    lines[:] = blocks


def setup(app: Sphinx) -> dict[str, bool]:
    """Convert what autodoc reads."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", to_blocks, priority=BEFORE_NAPOLEON)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
