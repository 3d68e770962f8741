"""The tables that are shipped are those of the grammar, and no others are ever used."""

from __future__ import annotations

import json

import lark
import pytest
from lark.exceptions import UnexpectedToken

from hprs.spec import grammar

GRAMMAR, TABLES = grammar.read("grammar.lark"), grammar.read("grammar_tables.json")
TEXT = """signal x[3] = obs.pose[0:2] initially 0 in [-1, 1] "m"
signal y in [-pi, 12 deg]
let d = -max(x) ** 2 + y / 3 in [0, 1]
ensure near: -1 <= y < 0.5 and (d > 0 or hypot(y, 1) <= 2)
prefer near over far
"""


def test_the_tables_are_those_of_the_grammar() -> None:
    if json.loads(TABLES)["lark"] != lark.__version__:
        pytest.skip("the tables belong to the version of lark in constraints.txt")
    loaded = grammar.from_tables(GRAMMAR, TABLES, None)
    assert loaded is not None, "run python tests/spec/grammar_tables.py"
    assert json.loads(TABLES).keys() == json.loads(grammar.tables_of(GRAMMAR)).keys()
    built = grammar.build(GRAMMAR, None)
    assert loaded.parse(TEXT) == built.parse(TEXT)
    for wrong in ("ensure a: x <", "signal x in [0 1]\n", "let a = 1 in\n", "a"):
        errors: list[UnexpectedToken] = []
        for parser in (loaded, built):
            with pytest.raises(UnexpectedToken) as caught:
                parser.parse(wrong)
            errors.append(caught.value)
        assert errors[0].token == errors[1].token
        assert errors[0].expected == errors[1].expected


@pytest.mark.parametrize(
    "damaged",
    [
        "",
        "{",
        "[]",
        "null",
        TABLES[:5000],
        '{"lark": 1}',
        json.dumps(json.loads(TABLES) | {"data": 3}),
    ],
    ids=range(7),
)
def test_damaged_tables_are_not_used(damaged: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert grammar.from_tables(GRAMMAR, damaged, None) is None
    monkeypatch.setattr(
        grammar, "read", {"grammar.lark": GRAMMAR, "grammar_tables.json": damaged}.get
    )
    assert grammar.load_grammar(None).parse(TEXT) == grammar.build(GRAMMAR, None).parse(TEXT)


@pytest.mark.parametrize("key", ["lark", "grammar"])
def test_tables_of_another_grammar_or_version_are_not_used(
    key: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = json.loads(TABLES)
    content[key] += " "
    stale = json.dumps(content)
    assert grammar.from_tables(GRAMMAR, stale, None) is None
    monkeypatch.setattr(
        grammar, "read", {"grammar.lark": GRAMMAR, "grammar_tables.json": stale}.get
    )
    assert grammar.load_grammar(None).parse(TEXT) == grammar.build(GRAMMAR, None).parse(TEXT)
