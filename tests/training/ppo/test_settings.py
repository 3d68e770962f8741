"""The table of settings in the docs says what the code says."""

import ast
import inspect
import json
from dataclasses import fields
from pathlib import Path

from hprs.training.ppo import settings
from hprs.training.ppo.settings import Settings

PAGE = Path(__file__).parents[3] / "docs" / "ppo.md"


def docstrings():
    [body] = ast.parse(inspect.getsource(settings.Settings)).body
    found = {}
    for line, following in zip(body.body, body.body[1:], strict=False):
        if isinstance(line, ast.AnnAssign) and isinstance(following, ast.Expr):
            found[line.target.id] = " ".join(following.value.value.split())
    return found


def test_every_setting_is_in_the_table_with_its_default_and_meaning():
    meanings, defaults = docstrings(), Settings()
    wanted = [
        f"| `{one.name}` | {json.dumps(getattr(defaults, one.name))} | {meanings[one.name]} |"
        for one in fields(Settings)
    ]
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line in wanted] == wanted
