import errno
import json

import pytest

from hprs.cli import trace_csv

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
        (
            "x,v,thta\n1,2,3\n1,2,3\n",
            "trace.csv has no column 'theta'; it has x, v, thta. Did you mean 'thta'? "
            "With --missing unknown the requirements that need it are unknown.",
        ),
        ("x,v,theta\n1,2,3\n,,\n1,2,\n", "trace.csv:4: column 'theta' is empty."),
        ('x,v,note,theta\n1,2,"two\nlines",3\n1,two,,3\n', "trace.csv:4: column 'v' 'two' is not a number."),
        ("time,x,v,theta\n0,1,2,3\n0.02,1,2,3\n0.02,1,2,3\n", "trace.csv:4: time stamps must increase, but 'time' is 0.02 after 0.02."),
        ("T,x,v,theta\n0.5,1,2,3\n\n0.25,1,2,3\n", "trace.csv:4: time stamps must increase, but 'T' is 0.25 after 0.5."),
        ("stamp,x,v,theta\n2026-01-01T00:00:01,1,2,3\n2026-01-01T00:00:00.5Z,1,2,3\n", "trace.csv:3: time stamps must increase, but 'stamp' is 2026-01-01T00:00:00.5Z after 2026-01-01T00:00:01."),
        ("time,x,v,theta\n0,1,2,3\nnan,1,2,3\n", "trace.csv:3: time stamps must increase, but 'time' is nan after 0."),
        ("time,x,v,theta\n0,1,2,3\nlate,1,2,3\n", "trace.csv:3: time stamp 'late' in column 'time' is neither a number nor a date as 2026-01-31T12:00:00."),
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
    assert (code, err) == (
        2,
        f"hprs: '{here}' is a folder; a trace is a CSV file, a Parquet file or a rosbag.\n",
    )


def test_an_unreadable_trace_exits_with_1(hprs, trace, monkeypatch):
    def refuse(path):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(trace_csv.csv, "reader", refuse)
    code, _, err = hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0")
    assert (code, err) == (1, "hprs: trace.csv cannot be read: Permission denied.\n")


def test_time_stamps_can_have_another_name_or_none(hprs, here):
    (here / "trace.csv").write_text(TRACE.replace("0.04", "0.01").replace("time", "seconds"))
    call = ("assess", "trace.csv", "--task", "hprs/CartPole-v0")
    assert hprs(*call)[0] == 0
    assert hprs(*call, "--time", "seconds") == (
        1, "", "hprs: trace.csv:4: time stamps must increase, but 'seconds' is 0.01 after 0.02.\n",
    )  # fmt: skip
    code, _, err = hprs(*call, "--time", "second")
    assert (code, err.endswith("Did you mean 'seconds'?\n")) == (1, True)
    (here / "trace.csv").write_text(TRACE.replace("0.04", "0.01"))
    assert hprs(*call)[0] == 1
    assert hprs(*call, "--time", "")[0] == 0


@pytest.mark.parametrize("first", [1_700_000_000_000_000_000, 0])
def test_nanoseconds_are_compared_as_integers(hprs, here, first):
    stamps = [first + 100 * row for row in range(3)]
    lines = [f"{stamp},1,2,3" for stamp in stamps]
    (here / "trace.csv").write_text("\n".join(["time,x,v,theta", *lines]))
    assert hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0")[0] == 0
    (here / "trace.csv").write_text("\n".join(["time,x,v,theta", *lines, lines[2]]))
    assert hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0") == (
        1,
        "",
        f"hprs: trace.csv:5: time stamps must increase, but 'time' is {stamps[2]} after {stamps[2]}.\n",
    )


def test_a_margin_that_is_no_number_is_one_line(hprs, here):
    (here / "root.hprs").write_text("signal x in [0, 1]\nensure a: sqrt(x) <= 0.9\n")
    (here / "trace.csv").write_text("x\n0.5\n0.5\n-0.2\n")
    options = ("assess", "trace.csv", "--task", "root.hprs")
    assert hprs(*options) == (
        1,
        "",
        "hprs: the margin of requirement 'a' is NaN at step 2: a signal has left the range in which "
        "its expression is defined.\n",
    )
    code, out, err = hprs(*options, "--missing", "unknown", "--json")
    assert (code, json.loads(out)["unknown"], err) == (0, ["a"], "")


def test_a_signal_named_as_time_is_no_time_stamp(hprs, here):
    (here / "left.hprs").write_text("signal t in [0, 9]\nensure in_time: t >= 1\n")
    (here / "trace.csv").write_text("t\n3\n2\n1\n")
    code, out, _ = hprs("assess", "trace.csv", "--task", "left.hprs", "--json")
    assert (code, json.loads(out)["safe"]) == (0, True)


def test_a_missing_signal_makes_unknown_what_needs_it(hprs, here):
    (here / "trace.csv").write_text(TRACE.replace("theta", "angle"))
    call = ("assess", "trace.csv", "--task", "hprs/CartPole-v0", "--missing", "unknown")
    code, out, _ = hprs(*call)
    assert code == 0
    lines = [" ".join(line.split()) for line in out.splitlines()]
    assert "trace.csv: 2 steps, PAM unknown" in lines
    for line in ("pole_up ensure unknown", "on_track ensure met", "slow encourage 50.0% of steps"):
        assert line in lines
    assert lines[-4:] == [
        "safe: unknown",
        "on target: yes",
        "comfort: unknown",
        "The log does not say whether pole_up, upright is met.",
    ]
    code, out, _ = hprs(*call, "--json")
    found = json.loads(out)
    assert (found["pam"], found["safe"], found["target"]) == (None, None, True)
    assert found["unknown"] == ["pole_up", "upright"]


def test_an_empty_cell_is_a_gap_and_a_violation_beside_it_counts(hprs, here):
    text = "x,v,theta\n0,0,0\n,,\n9,,0\n1,nan,0\n"
    (here / "trace.csv").write_text(text)
    code, out, _ = hprs(
        "assess", "trace.csv", "--task", "hprs/CartPole-v0", "--missing", "unknown", "--json"
    )
    found = json.loads(out)
    assert (code, found["steps"], found["safe"], found["unknown"]) == (0, 2, False, ["slow"])


def test_a_log_with_no_signal_at_all_says_so(hprs, here):
    (here / "trace.csv").write_text("a,b\n1,2\n1,2\n")
    assert hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0", "--missing", "unknown") == (
        1,
        "",
        "hprs: trace.csv has none of the signals; it has a, b.\n",
    )


def test_columns_can_have_other_names(hprs, here):
    (here / "trace.csv").write_text(TRACE.replace("theta", "angle [rad]"))
    call = ("assess", "trace.csv", "--task", "hprs/CartPole-v0", "--json")
    code, out, _ = hprs(*call, "--column", "theta=angle [rad]")
    assert (code, json.loads(out)["pam"]) == (0, 1.625)
    for pair, code, message in [
        ("thta=angle [rad]", 2, "--column: the task has no signal 'thta'. Did you mean 'theta'?"),
        ("theta", 2, "--column takes SIGNAL=COLUMN, not 'theta'."),
    ]:
        assert hprs(*call, "--column", pair) == (code, "", f"hprs: {message}\n")
    code, _, err = hprs(*call, "--column", "theta=angle", "--missing", "unknown")
    assert code == 1
    assert "trace.csv has no column 'angle'; it has time, x, v, angle [rad]." in err


def test_a_long_trace_is_read_in_pieces(hprs, here):
    rows = "".join(f"{i},0,0,{0.06 * (i % 2)}\n" for i in range(40_001))
    (here / "trace.csv").write_text("time,x,v,theta\n" + rows)
    call = ("assess", "trace.csv", "--task", "hprs/CartPole-v0", "--json")
    found = json.loads(hprs(*call)[1])
    assert (found["steps"], found["requirements"]["upright"]) == (40_000, 0.5)
    (here / "trace.csv").write_text("time,x,v,theta\n" + rows + "40000.5,0,0,0\n40000,0,0,0\n")
    message = (
        "hprs: trace.csv:40004: time stamps must increase, but 'time' is 40000 after 40000.5.\n"
    )
    assert hprs(*call) == (1, "", message)
    (here / "trace.csv").write_text("time,x,v,theta\n" + rows + "40001,0,0,\n")
    assert hprs(*call) == (1, "", "hprs: trace.csv:40003: column 'theta' is empty.\n")


def test_ticks_are_for_rosbags(hprs, trace):
    code, _, err = hprs("assess", "trace.csv", "--task", "hprs/CartPole-v0", "--ticks", "/cmd")
    assert (code, err) == (2, "hprs: --ticks is for rosbags; in 'trace.csv' every row is one.\n")
