import subprocess
import sys

import pytest

from hprs.cli import main

MOUNTAIN = """
signal position = obs[0] in [-1.2, 0.6] "m"
signal velocity = obs[1] in [-0.07, 0.07]
achieve top: position >= 0.45
encourage gentle: abs(velocity) <= 0.05
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working directory with a task file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mountain.hprs").write_text(MOUNTAIN)
    return tmp_path


@pytest.fixture
def hprs(here, capsys):
    """Runs a command line; gives exit code, output and errors."""

    def run(*arguments):
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


@pytest.fixture
def process(here):
    """Runs a command line in a process of its own."""

    def run(*arguments, **options):
        return subprocess.run(
            [sys.executable, "-m", "hprs", *map(str, arguments)],
            capture_output=True,
            text=True,
            check=False,
            **options,
        )

    return run
