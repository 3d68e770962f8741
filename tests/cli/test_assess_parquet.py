import json

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from hprs.cli import trace_columns, trace_parquet

TASK = """signal d[2] in [0, 9]
signal v in [0, 5]
ensure clear: min(d) >= 1
encourage fast: v >= 2
"""
D = [[3.0, 2.0], [2.0, 3.0], [0.5, 4.0]]


@pytest.fixture
def assess(hprs, here):
    """Assesses a table; gives the exit code, and the JSON or the complaint."""
    (here / "task.hprs").write_text(TASK)

    def run(columns, *options):
        parquet.write_table(pa.table(columns), here / "log.parquet")
        code, out, err = hprs("assess", "log.parquet", "--task", "task.hprs", "--json", *options)
        return code, json.loads(out) if code == 0 else err.removeprefix("hprs: ").strip()

    return run


def components(rows):
    return {f"d[{i}]": [row[i] for row in rows] for i in range(2)}


@pytest.mark.parametrize(
    "columns",
    [
        {"d": D, "v": [1, 2, 3]},
        {"d": pa.array(D, pa.list_(pa.float32(), 2)), "v": [1.0, 2.0, 1.0]},
        components(D) | {"v": pa.array([1, 0, 2], pa.uint8())},
        components(D) | {"v": pa.array([0, 3, 1]).cast(pa.decimal128(25, 2)), "text": list("abc")},
    ],
)  # fmt: skip
def test_a_parquet_file_is_assessed_as_a_csv_file(assess, columns):
    code, found = assess(columns)
    assert (code, found["safe"], found["steps"]) == (0, False, 2)
    v = np.asarray(columns["v"], float)
    assert found["requirements"] == {"clear": False, "fast": (v[1:] >= 2).mean()}


def test_a_file_is_read_in_pieces(assess, monkeypatch):
    for module in (trace_columns, trace_parquet):
        monkeypatch.setattr(module, "CHUNK", 100)
    v = np.arange(250) % 5
    columns = {"time": np.arange(250), "d": [[2.0, 2.0]] * 250, "v": v}
    code, found = assess(columns)
    assert (code, found["requirements"]["fast"]) == (0, float((v[1:] >= 2).mean()))
    columns["time"][205] = 204
    message = "log.parquet, row 206: time stamps must increase, but 'time' is 204 after 204."
    assert assess(columns) == (1, message)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"d": D}, "log.parquet has no column 'v'; it has d. With --missing unknown the requirements that need it are unknown."),
        ({"d": D, "v": ["a", "b", "c"]}, "log.parquet, row 1: column 'v' is of type string, not a number."),
        ({"d": D, "v": [1.0, None, 2.0]}, "log.parquet, row 2: column 'v' is empty."),
        ({"d": D, "v": [1.0, 2.0, float("nan")]}, "log.parquet, row 3: column 'v' is NaN."),
        ({"d": [[1.0, 1.0], [1.0], [1.0, 1.0]], "v": [1, 1, 1]}, "log.parquet, row 2: column 'd' has 1 component, the signal 2."),
        ({"d": [[1.0, 1.0], None], "v": [1, 1]}, "log.parquet, row 2: column 'd' is empty."),
        ({"d": pa.array([[1.0, 1.0], None], pa.list_(pa.float64(), 2)), "v": [1, 1]}, "log.parquet, row 2: column 'd' is empty."),
        ({"d": [None, None], "v": [1, 1]}, "log.parquet, row 1: column 'd' is empty."),
        ({"d": D, "v": [None, None, None]}, "log.parquet, row 1: column 'v' is empty."),
        ({"d": [[1.0, 1.0], [1.0, None]], "v": [1, 1]}, "log.parquet, row 2: column 'd' is empty."),
        ({"d": D[:1], "v": [1.0]}, "log.parquet has 1 row; it needs the initial state and at least one step."),
        ({"t": np.array([5, 5, 6], "datetime64[s]"), "d": D, "v": [1, 1, 1]}, "log.parquet, row 2: time stamps must increase, but 't' is 1970-01-01 00:00:05 after 1970-01-01 00:00:05."),
        ({"t": [5, None, 6], "d": D, "v": [1, 1, 1]}, "log.parquet, row 2: column 't' is empty."),
        ({"t": [None, None, None], "d": D, "v": [1, 1, 1]}, "log.parquet, row 1: column 't' is empty."),
        ({"t": list("abc"), "d": D, "v": [1, 1, 1]}, "log.parquet: time stamps are numbers or dates; 't' is string."),
    ],
)  # fmt: skip
def test_a_wrong_file_says_where(assess, columns, message):
    assert assess(columns) == (1, message)


def test_what_is_missing_is_unknown(assess):
    code, found = assess({"d": D}, "--missing", "unknown")
    assert (code, found["pam"], found["safe"], found["unknown"]) == (0, None, False, ["fast"])
    code, found = assess({"d": D[:2], "v": [1.0, None]}, "--missing", "unknown")
    assert (code, found["safe"], found["unknown"]) == (0, True, ["fast"])


@pytest.mark.parametrize("kind", [pa.list_(pa.float64()), pa.list_(pa.float64(), 2)])
def test_an_empty_cell_of_a_vector_is_unknown(assess, kind):
    d = pa.array([[2.0, 2.0], None, [3.0, 2.0]], kind)
    code, found = assess({"d": d, "v": [1, 2, 3]}, "--missing", "unknown")
    assert (code, found["safe"], found["unknown"]) == (0, None, ["clear"])
    assert found["requirements"]["fast"] == 1.0
    # A violation elsewhere decides.
    d = pa.array([None, [0.5, 2.0], [3.0, 2.0]], kind)
    code, found = assess({"d": d, "v": [1, 2, 3]}, "--missing", "unknown")
    assert (code, found["safe"], found["pam"]) == (0, False, 0.75)


def test_columns_of_empty_cells_are_unknown(assess):
    code, found = assess({"d": [None] * 3, "v": [1, 2, 3]}, "--missing", "unknown")
    assert (code, found["unknown"]) == (0, ["clear"])
    code, found = assess({"d": D, "v": [None] * 3}, "--missing", "unknown")
    assert (code, found["unknown"]) == (0, ["fast"])


@pytest.mark.parametrize("kind", ["int64", "uint64", "datetime64[ns]"])
@pytest.mark.parametrize("chunk", [2, 100])
def test_nanoseconds_are_compared_as_integers(assess, monkeypatch, kind, chunk):
    monkeypatch.setattr(trace_parquet, "CHUNK", chunk)
    stamps = 1_700_000_000_000_000_000 + np.arange(3) * 100
    code, found = assess({"t": stamps.astype(kind), "d": D, "v": [1, 2, 3]})
    assert code == 0, found
    stamps[2] = stamps[1]
    code, message = assess({"t": stamps.astype(kind), "d": D, "v": [1, 2, 3]})
    assert code == 1
    assert message.startswith("log.parquet, row 3: time stamps must increase, but 't' is ")


def test_what_is_no_parquet_file_says_so(hprs, here):
    (here / "task.hprs").write_text(TASK)
    (here / "log.parquet").write_text("d,v\n")
    code, _, err = hprs("assess", "log.parquet", "--task", "task.hprs")
    assert code == 1
    assert err.startswith("hprs: log.parquet cannot be read as a Parquet file: ")
