"""What runs on a robot is light, and old Pythons read it."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import hprs

HERE = Path(hprs.__file__).parent
FILES = [*sorted(HERE.glob("deploy/*.py")), HERE / "errors.py", HERE / "__init__.py"]
NAMES = ["archive", "bundle", "layouts"]
"""What the package has; only these are imported."""
GENERICS = {"dict", "list", "tuple", "set", "frozenset", "type", "Iterable", "Sequence", "Callable"}


def test_numpy_is_all_it_imports():
    code = """
import sys
import hprs
hprs.deploy.load_bundle
foreign = {name.partition(".")[0] for name in sys.modules}
print(sorted(foreign & {"gymnasium", "jax", "torch", "lark", "rich", "tyro", "scipy"}))
print(sorted(name for name in sys.modules if name.startswith("hprs")))
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    foreign, own = run.stdout.splitlines()
    assert foreign == "[]"
    assert ast.literal_eval(own) == sorted(
        ["hprs", "hprs.deploy", *(f"hprs.deploy.{name}" for name in NAMES), "hprs.errors"]
    )


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_python_3_8_reads_it(file):
    tree = ast.parse(file.read_text("utf-8"), feature_version=(3, 8))
    # Annotations are text then; what is left of the newer notation is evaluated.
    assert any(isinstance(n, ast.ImportFrom) and n.module == "__future__" for n in tree.body) or (
        file.name == "__init__.py" and file.parent.name == "deploy"
    )
    # Those of typing are as old as Python 3.5.
    old = {
        alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module == "typing"
        for alias in node.names
    }
    newer = [node for node in evaluated(tree) if is_newer(node)]
    assert not [
        ast.unparse(n) for n in newer if getattr(getattr(n, "value", 0), "id", "") not in old
    ]


@pytest.mark.parametrize(
    "source",
    [
        "A = dict[str, int]",
        "A = int | None",
        "a = {**b} | {'c': 1}",
        "class A(tuple[int, int]): pass",
        "text.removeprefix('a')",
        "zip(a, b, strict=True)",
        "@dataclass(frozen=True, slots=True)\nclass A: pass",
        "A: TypeAlias = Iterable[int]",
    ],
)
def test_what_python_3_8_cannot_run_is_found(source):
    assert any(is_newer(node) for node in evaluated(ast.parse(source)))


def test_annotations_may_be_of_today():
    source = "def f(a: dict[str, int] | None) -> list[int]: ...\na: int | None = 1"
    assert not any(is_newer(node) for node in evaluated(ast.parse(source)))


def evaluated(tree):
    """The nodes that run: all but annotations and what only type checkers read."""
    yield tree
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns"):
            continue
        if isinstance(tree, ast.If) and ast.unparse(tree.test) == "TYPE_CHECKING":
            continue
        for node in value if isinstance(value, list) else [value]:
            if isinstance(node, ast.AST):
                yield from evaluated(node)


def is_newer(node):
    """Whether it looks like what Python 3.8 parses and cannot run."""
    if isinstance(node, ast.Subscript):
        return isinstance(node.value, ast.Name) and node.value.id in GENERICS
    if isinstance(node, ast.BinOp):
        return isinstance(node.op, ast.BitOr)
    if isinstance(node, ast.Attribute):
        return node.attr in ("removeprefix", "removesuffix", "with_stem", "is_relative_to")
    if isinstance(node, ast.Call):
        return any(keyword.arg in ("strict", "slots", "kw_only") for keyword in node.keywords)
    return False
