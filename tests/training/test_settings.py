"""The tables of settings in the docs say what the code says."""

import ast
import importlib
import inspect
import json
from dataclasses import fields
from pathlib import Path

import pytest

from hprs.training.algorithms import TRAINERS

DOCS = Path(__file__).parents[2] / "docs"


def docstrings(settings):
    [body] = ast.parse(inspect.getsource(settings.Settings)).body
    found = {}
    for line, following in zip(body.body, body.body[1:], strict=False):
        if isinstance(line, ast.AnnAssign) and isinstance(following, ast.Expr):
            found[line.target.id] = " ".join(following.value.value.split())
    return found


@pytest.mark.parametrize("algorithm", TRAINERS["jax"])
def test_every_setting_is_in_the_table_with_its_default_and_meaning(algorithm):
    settings = importlib.import_module(f"hprs.training.{algorithm}.settings")
    meanings, defaults = docstrings(settings), settings.Settings()
    wanted = [
        f"| `{one.name}` | {json.dumps(getattr(defaults, one.name))} | {meanings[one.name]} |"
        for one in fields(settings.Settings)
    ]
    lines = (DOCS / f"{algorithm}.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line in wanted] == wanted
