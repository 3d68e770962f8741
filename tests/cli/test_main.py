import sys

import pytest

from hprs.cli.commands import COMMANDS


def test_help_lists_the_commands_with_examples(hprs):
    code, out, _ = hprs("--help")
    assert code == 0
    assert "Examples:" in out
    assert all(f"• {name}" in out for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_has_examples(hprs, name):
    code, out, _ = hprs(name, "--help")
    assert code == 0
    assert "Examples:" in out
    assert f"hprs {name}" in out


@pytest.mark.parametrize("arguments", [("chek",), (), ("check",), ("tasks", "--verbose")])
def test_a_wrong_call_exits_with_2(hprs, arguments):
    code, out, err = hprs(*arguments)
    assert code == 2
    assert out == ""
    assert err


def test_the_module_runs_the_command_line(process):
    done = process("check", "nowhere.hprs")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "hprs: there is no task 'nowhere.hprs'.\n"


def test_checking_a_task_needs_neither_learners_nor_environments(process, here):
    (here / "probe.py").write_text(
        "import sys\n"
        "from hprs.cli import main\n"
        "code = main(['check', 'mountain.hprs'])\n"
        "heavy = {'torch', 'stable_baselines3', 'scipy', 'matplotlib', 'jax', 'gymnasium'}\n"
        "sys.exit(code or ', '.join(heavy & set(sys.modules)) or 0)\n"
    )
    import subprocess

    done = subprocess.run([sys.executable, "probe.py"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
