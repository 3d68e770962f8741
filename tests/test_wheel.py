import zipfile
from pathlib import Path

import pytest

import hprs
from hprs.envs import BENCHMARKS

ROOT = Path(hprs.__file__).parents[2]


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="hprs is installed already")
def test_the_wheel_holds_every_file_that_is_no_module(tmp_path):
    wheel = pytest.importorskip("hatchling.builders.wheel")
    [built] = wheel.WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    names = set(zipfile.ZipFile(built).namelist())
    for benchmark in BENCHMARKS.values():
        folder = benchmark.package.replace(".", "/")
        assert {f"{folder}/task.hprs", f"{folder}/{benchmark.hyperparameters}"} <= names
    assert {"hprs/spec/grammar.lark", "hprs/py.typed"} <= names
