import zipfile
from pathlib import Path

import pytest

import hprs

ROOT = Path(hprs.__file__).parents[2]


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="hprs is installed already")
def test_the_wheel_holds_every_file_that_is_no_module(tmp_path):
    wheel = pytest.importorskip("hatchling.builders.wheel")
    [built] = wheel.WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    names = set(zipfile.ZipFile(built).namelist())
    source = ROOT / "src"
    wanted = {
        file.relative_to(source).as_posix()
        for file in (source / "hprs").rglob("*")
        if file.is_file() and file.suffix not in (".py", ".pyc")
    }
    assert {"hprs/spec/grammar.lark", "hprs/spec/grammar_tables.json", "hprs/py.typed"} <= wanted
    assert wanted <= names
