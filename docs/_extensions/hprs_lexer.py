"""Colours the task language; its words are those of the grammar."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pygments.lexer import RegexLexer, words
from pygments.token import Comment, Keyword, Name, Number, Operator, Punctuation, String, Text

from hprs.spec.vocabulary import BUILTIN_CONSTANTS, FUNCTIONS, KEYWORDS

if TYPE_CHECKING:
    from sphinx.application import Sphinx


class TaskLexer(RegexLexer):
    """Tokens of a task file."""

    name = "hprs"
    aliases: ClassVar = ["hprs"]
    filenames: ClassVar = ["*.hprs"]
    tokens: ClassVar = {
        "root": [
            (r"#.*", Comment.Single),
            (r'"[^"\n]*"', String),
            (words(sorted(KEYWORDS), prefix=r"\b", suffix=r"\b"), Keyword),
            (words(sorted(FUNCTIONS), prefix=r"\b", suffix=r"\b(?=\s*\()"), Name.Builtin),
            (words(sorted(BUILTIN_CONSTANTS), prefix=r"\b", suffix=r"\b"), Name.Constant),
            (r"\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?", Number),
            (r"[A-Za-z_]\w*(?=:)", Name.Label),
            (r"[A-Za-z_]\w*", Name),
            (r"<=|>=|\*\*|[-+*/<>=]", Operator),
            (r"[][(),:.]", Punctuation),
            (r"\s+", Text),
        ]
    }


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the language known to fences."""
    app.add_lexer("hprs", TaskLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
