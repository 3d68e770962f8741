import errno
import json

import pytest

from hprs.cli import trace_file

TRACE = """time,x,v,theta
0.00,0.0,0.0,0.0
0.02,0.9,0.7,0.0
0.04,1.0,0.0,0.06
"""


@pytest.fixture
def trace(here):
    (here / "trace.csv").write_text(TRACE)


def test_a_trace_is_assessed_from_its_first_state_on(hprs, trace):
    code, out, _ = hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0", "--json")
    assert code == 0
    assert json.loads(out) == {
        "trace": "trace.csv",
        "steps": 2,
        "pam": 1.625,
        "safe": True,
        "target": True,
        "satisfied": True,
        "comfort": 0.5,
        "requirements": {
            "on_track": True,
            "pole_up": True,
            "parked": True,
            "upright": 0.5,
            "slow": 0.5,
        },
        "outside_ranges": {},
        "decided_at_start": False,
    }


def test_a_trace_is_assessed_by_other_constants(hprs, trace):
    code, out, _ = hprs(
        "assess", "trace.csv", "--task", "hprs/CartPole-v0", "--const", "mark=-1", "--json"
    )
    assert (code, json.loads(out)["target"]) == (0, False)


def test_the_table_says_what_is_met(hprs, here):
    (here / "trace.csv").write_text(TRACE.replace("0.04,1.0", "0.04,9.0"))
    code, out, _ = hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0")
    assert code == 0
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "trace.csv: 2 steps, PAM 0.125" in lines
    assert "on_track ensure violated" in lines
    assert "pole_up ensure met" in lines
    assert "slow encourage 50.0% of steps" in lines
    assert "Signal 'x' left its range in 1 of 3 states." in lines


def test_a_vector_is_read_from_numbered_columns(hprs, here):
    (here / "vector.hprs").write_text(
        "signal d[2] = obs[0:2] in [0, 9]\nensure clear: min(d) >= 1\n"
    )
    (here / "trace.csv").write_text("d[1],d[0]\n2,3\n2,0.5\n")
    code, out, _ = hprs("assess", "trace.csv", "--task", "vector.hprs", "--json")
    assert code == 0
    assert json.loads(out)["requirements"] == {"clear": False}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "trace.csv is empty; it needs a header of signal names and one row a step."),
        ("\n\n", "trace.csv is empty; it needs a header of signal names and one row a step."),
        ("x,v,theta\n", "trace.csv has 0 rows; it needs the initial state and at least one step."),
        ("x,v,theta\n1,2,3\n", "trace.csv has 1 row; it needs the initial state and at least one step."),
        ("x,v,thta\n1,2,3\n1,2,3\n", "trace.csv has no column 'theta'; it has x, v, thta. Did you mean 'thta'?"),
        ("x,v,theta\n1,2,3\n1,two,3\n", "trace.csv:3: column 'v' 'two' is not a number."),
        ("x,v,theta\n1,2,3\n1,1_0,3\n", "trace.csv:3: column 'v' '1_0' is not a number."),
        ("x,v,theta\n1,,3\n1,2,3\n", "trace.csv:2: column 'v' is empty."),
        ("x,v,theta\n\n1,2,3\n1,2,nan\n", "trace.csv:4: column 'theta' is NaN."),
        ("x,v,theta\n1,2,3\n1,2\n", "trace.csv:3: 2 values below 3 column names."),
        ("x,x,theta\n1,2,3\n1,2,3\n", "trace.csv has column 'x' twice."),
    ],
)  # fmt: skip
def test_a_wrong_trace_exits_with_1_and_says_where(hprs, here, text, message):
    (here / "trace.csv").write_text(text)
    assert hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0") == (
        1,
        "",
        f"hprs: {message}\n",
    )


def test_a_task_that_reads_no_signal_says_so(hprs, here):
    (here / "idle.hprs").write_text("signal x in [0, 1]\nensure always: 1 > 0\n")
    (here / "trace.csv").write_text("x\n0\n1\n1\n")
    assert hprs("assess", "trace.csv", "--task", "idle.hprs") == (
        1, "", "hprs: the task reads no signal, so that a trace says nothing of it.\n",
    )  # fmt: skip


def test_a_binary_file_is_no_trace(hprs, here):
    (here / "trace.csv").write_bytes(b"\xff\xfe\x00")
    code, _, err = hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0")
    assert (code, err) == (1, "hprs: trace.csv is not text in UTF-8; a trace is a CSV file.\n")


def test_a_missing_trace_or_task_exits_with_2(hprs, trace):
    assert hprs("assess", "trce.csv", "--task", "hprs/CartPole-v0") == (
        2, "", "hprs: there is no trace file 'trce.csv'. Did you mean 'trace.csv'?\n",
    )  # fmt: skip
    code, _, err = hprs("assess", "trace.csv", "--task", "x.hprs")
    assert (code, err) == (2, "hprs: there is no task 'x.hprs'.\n")


def test_a_folder_is_no_trace(hprs, here):
    code, _, err = hprs("assess", here, "--task", "mountain.hprs")
    assert (code, err) == (2, f"hprs: '{here}' is a folder; a trace is a CSV file.\n")


def test_an_unreadable_trace_exits_with_1(hprs, trace, monkeypatch):
    def refuse(path):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(trace_file.csv, "reader", refuse)
    code, _, err = hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0")
    assert (code, err) == (1, "hprs: trace.csv cannot be read: Permission denied.\n")
