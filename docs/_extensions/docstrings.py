"""What the project's docstrings do and Sphinx does not expect.

They fence text as Markdown does, and a field's sentence may hold a colon, before which Napoleon
would look for a type.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

BEFORE_NAPOLEON, AFTER_NAPOLEON = 400, 600
FIELDS = ("attribute", "data", "property")
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


class Fields:
    """Keeps the sentences of fields from Napoleon."""

    def __init__(self) -> None:
        self.sentences: dict[str, list[str]] = {}

    def keep(
        self, _app: Sphinx, what: str, name: str, _object: Any, _options: Any, lines: list[str]
    ) -> None:
        """Remember a field's docstring."""
        if what in FIELDS:
            self.sentences[name] = list(lines)

    def restore(
        self, _app: Sphinx, what: str, name: str, _object: Any, _options: Any, lines: list[str]
    ) -> None:
        """Put it back as it was."""
        if what in FIELDS:
            lines[:] = self.sentences.pop(name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Convert what autodoc reads."""
    app.setup_extension("sphinx.ext.autodoc")
    fields = Fields()
    app.connect("autodoc-process-docstring", to_blocks, priority=BEFORE_NAPOLEON)
    app.connect("autodoc-process-docstring", fields.keep, priority=BEFORE_NAPOLEON)
    app.connect("autodoc-process-docstring", fields.restore, priority=AFTER_NAPOLEON)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
