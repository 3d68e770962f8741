"""Writes the tables of the grammar: `python tests/spec/grammar_tables.py`."""

from __future__ import annotations

from pathlib import Path

import hprs.spec.grammar as grammar

if __name__ == "__main__":
    tables = grammar.tables_of(grammar.read("grammar.lark"))
    Path(grammar.__file__).with_name("grammar_tables.json").write_text(tables, encoding="utf-8")
