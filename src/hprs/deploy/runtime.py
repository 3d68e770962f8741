"""Writes the runtime: the modules that a robot needs as one file, for Python 3.8 and NumPy alone.

The modules stand one after the other in it, without their imports of each other; nothing else is
changed. What a robot runs is therefore what is tested here.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Dict, List, Tuple

MODULES = (
    "errors",
    "deploy.layouts",
    "deploy.bundle",
    "deploy.archive",
    "deploy.scan",
    "deploy.driving",
    "deploy.monitor",
    "deploy.record",
    "deploy.loop",
    "deploy.command",
)
"""What the runtime is made of, below `hprs`; each needs only those before it."""
NAME = "policy_runtime.py"
"""Its file."""

_PACKAGE = "hprs"
_HEAD = '''"""Runs a policy bundle with Python 3.8 or later and NumPy alone; written by {writer}.

python3 {name} policy.bundle            check the policy, and say what it is

import {module}
bundle = {module}.load_bundle("policy.bundle")
bundle.self_check()
action = bundle(observation)

Do not edit it: it is made of the modules of hprs.deploy, and `hprs export` writes it anew.
"""

from __future__ import annotations

'''
_TAIL = """

if __name__ == "__main__":
    sys.exit(main())
"""


def runtime_source(writer: str) -> str:
    """The text of the runtime.

    Args:
        writer: The program that writes it, with its version.

    Raises:
        ValueError: Two modules define the same name, or one cannot be taken out of its package.
    """
    parts: List[str] = []
    imports: Dict[str, None] = {"import sys": None}
    homes: Dict[str, str] = {}
    for module in MODULES:
        text = _file(module).read_text(encoding="utf-8")
        body, needed = _taken_apart(module, text, homes)
        parts.append(body)
        imports.update(dict.fromkeys(needed))
    head = _HEAD.format(writer=writer, name=NAME, module=NAME[: -len(".py")])
    return head + "\n".join(sorted(imports)) + "\n" + "".join(parts) + _TAIL


def _file(module: str) -> Path:
    return Path(__file__).parents[1].joinpath(*module.split(".")).with_suffix(".py")


def _taken_apart(module: str, text: str, homes: Dict[str, str]) -> Tuple[str, List[str]]:
    """A module without docstring and imports, and the imports that the whole file needs.

    Args:
        module: Its name.
        text: Its text.
        homes: The modules of all names so far; this module's are added.
    """
    tree = ast.parse(text)
    lines: List[str] = text.splitlines(keepends=True)
    needed: List[str] = []
    for node in ast.walk(tree):
        inner = isinstance(node, ast.ImportFrom) and (node.module or "").startswith(_PACKAGE)
        if inner and node not in tree.body:
            raise ValueError("{} imports from {} inside a function.".format(module, _PACKAGE))
    for number, node in enumerate(tree.body):
        docstring = number == 0 and isinstance(node, ast.Expr)
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            needed += _kept(module, node)
        elif not docstring:
            _claim(module, node, homes)
            continue
        for line in range(node.lineno - 1, node.end_lineno or node.lineno):
            lines[line] = ""
    title = "\n\n# {} {}.{} {}\n".format("-" * 4, _PACKAGE, module, "-" * 40)
    return title + "\n\n" + "".join(lines).strip() + "\n", needed


def _kept(module: str, node: ast.AST) -> List[str]:
    """An import of another package, as lines."""
    if isinstance(node, ast.Import):
        return [_line(alias, "") for alias in node.names]
    if not isinstance(node, ast.ImportFrom):
        return []
    source = node.module or ""
    if source == "__future__":
        return []
    if source.split(".")[0] == _PACKAGE:
        if source[len(_PACKAGE) + 1 :] not in MODULES[: MODULES.index(module)]:
            raise ValueError(
                "{} imports {}, which does not stand before it.".format(module, source)
            )
        renamed = [alias.name for alias in node.names if alias.asname not in (None, alias.name)]
        if renamed:
            raise ValueError("{} imports {} under another name.".format(module, renamed[0]))
        return []
    return [_line(alias, "from {} ".format(source)) for alias in node.names]


def _line(alias: ast.alias, source: str) -> str:
    name = alias.name if alias.asname is None else "{} as {}".format(alias.name, alias.asname)
    return "{}import {}".format(source, name)


def _claim(module: str, node: ast.AST, homes: Dict[str, str]) -> None:
    """Remember what a statement defines.

    Raises:
        ValueError: Another module defines the same name.
    """
    names: List[str] = []
    if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
        names = [node.name]
    elif isinstance(node, ast.Assign):
        names = [found.id for one in node.targets for found in ast.walk(one) if _is_name(found)]
    elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
        names = [node.target.id]
    for name in names:
        other = homes.setdefault(name, module)
        if other != module:
            raise ValueError("{} and {} both define {}.".format(other, module, name))


def _is_name(node: ast.AST) -> bool:
    return isinstance(node, ast.Name)
