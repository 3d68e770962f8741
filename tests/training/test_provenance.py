import shutil
import subprocess
import sys
from pathlib import Path

from hprs.training import provenance


def test_versions_name_what_is_installed():
    found = provenance.versions()
    assert found["python"] == sys.version.split()[0]
    assert "numpy" in found


def test_nothing_of_the_user_or_the_host_is_recorded(monkeypatch):
    text = str(provenance.machine())
    assert str(Path.home()) not in text
    assert set(provenance.machine()) == {"system", "processor", "cores", "implementation"}


def test_the_commit_is_none_where_hprs_is_not_part_of_the_checkout(tmp_path, monkeypatch):
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    copy = shutil.copy(provenance.__file__, tmp_path / "provenance.py")
    monkeypatch.setattr(provenance, "__file__", str(copy))
    assert provenance.commit() is None


def test_the_commit_is_none_without_git(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert provenance.commit() is None
