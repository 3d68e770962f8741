# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# (lark annotates only parts of what is used here.)
"""Lark's parser of the grammar, from tables computed once a grammar and not once a process.

`grammar_tables.json` is written by `python tests/spec/grammar_tables.py`; a test says when it must
be written again.
"""

from __future__ import annotations

import json
import pkgutil
from collections.abc import Callable
from typing import Any, cast

import lark
from lark import Lark
from lark.grammar import Rule
from lark.lexer import TerminalDef


def load_grammar(builder: Any) -> Lark:
    """The parser of the task language.

    Args:
        builder: Its methods are called at each reduction, instead of making a tree.
    """
    grammar = read("grammar.lark")
    return from_tables(grammar, read("grammar_tables.json"), builder) or build(grammar, builder)


def build(grammar: str, builder: Any) -> Lark:
    """The parser of a grammar, with tables computed anew."""
    return Lark(grammar, parser="lalr", lexer="basic", transformer=builder, maybe_placeholders=True)


def from_tables(grammar: str, tables: str, builder: Any) -> Lark | None:
    """The parser of a grammar from what `tables_of` returned, in a quarter of the time.

    None where the tables are damaged, or those of another grammar or of another version of lark.
    """
    try:
        # JSON has no numbers as keys; lark needs them.
        content = json.loads(
            tables, object_hook=lambda o: {int(k) if k.isdigit() else k: v for k, v in o.items()}
        )
        if (content["lark"], content["grammar"]) != (lark.__version__, grammar):
            return None
        # As the parsers do that lark writes as modules; its public `load` takes no transformer.
        load = cast(Callable[..., Lark], Lark._load_from_dict)  # pyright: ignore[reportPrivateUsage]
        return load(content["data"], content["memo"], transformer=builder)
    except (ValueError, TypeError, LookupError, AttributeError):  # they only save time
        return None


def tables_of(grammar: str) -> str:
    """The tables of a grammar, with the grammar and the version of lark that they belong to."""
    data, memo = build(grammar, None).memo_serialize([TerminalDef, Rule])
    content = {"lark": lark.__version__, "grammar": grammar, "data": data, "memo": memo}
    return json.dumps(content, separators=(",", ":")) + "\n"


def read(name: str) -> str:
    """A file of this package."""
    # Not importlib.resources: lark needs pkgutil anyway, and the other costs four milliseconds.
    return (pkgutil.get_data("hprs.spec", name) or b"").decode()
