"""What assessing a long trace costs: time over that of reading its file, and peak memory.

    .venv/bin/python benchmarks/assess.py

Each file is read by its own library alone, to the end and keeping nothing: CSV by Python's `csv`,
Parquet by PyArrow's batches of the same columns, a rosbag by `rosbags`, messages deserialised. Then
`hprs assess` reads and assesses it. Every measurement has a process of its own; the time is that of
the work in it, without imports, and the whole command is shown beside it.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import contextlib
import csv
import io
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TASK = "hprs/CartPole-v0"
STEPS = (100_000, 1_000_000)
BAG_STEPS = (10_000, 100_000, 1_000_000)
REPEATS = 3
BAG_COLUMNS = ["--ticks", "/cmd", "--column", "x=/pose.x", "--column", "v=/pose.y"]
BAG_COLUMNS += ["--column", "theta=/pose.z"]


def write(folder: Path, kind: str, steps: int) -> Path:
    """A trace of the cart pole's three signals, and its time."""
    rng = np.random.default_rng(0)
    columns = {
        "time": np.arange(steps + 1) * 0.02,
        "x": rng.uniform(-2, 2, steps + 1),
        "v": rng.uniform(-1, 1, steps + 1),
        "theta": rng.uniform(-0.2, 0.2, steps + 1),
    }
    path = folder / f"{steps}.{kind}"
    if kind == "csv":
        with path.open("w") as file:
            file.write(",".join(columns) + "\n")
            np.savetxt(file, np.stack(list(columns.values()), axis=1), "%.8g", ",")
    elif kind == "parquet":
        import pyarrow
        from pyarrow import parquet

        parquet.write_table(pyarrow.table(columns), path)
    else:
        _write_bag(path, columns)
    return path


def _write_bag(path: Path, columns: dict[str, np.ndarray]) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    point, number = "geometry_msgs/msg/Point", "std_msgs/msg/Float64"
    make_point, make_number = store.types[point], store.types[number]
    with Writer(path) as bag:
        pose = bag.add_connection("/pose", point, typestore=store)
        command = bag.add_connection("/cmd", number, typestore=store)
        rows = zip(*(columns[name].tolist() for name in ("x", "v", "theta")), strict=True)
        for step, row in enumerate(rows):
            stamp = 1 + step * 20_000_000
            bag.write(pose, stamp, store.serialize_ros1(make_point(*row), point))
            bag.write(command, stamp, store.serialize_ros1(make_number(data=0.0), number))


def read(path: Path) -> None:
    """Read a file by its own library alone."""
    if path.suffix == ".csv":
        with path.open(newline="") as file:
            for _ in csv.reader(file):
                pass
    elif path.suffix == ".parquet":
        from pyarrow import parquet

        with parquet.ParquetFile(path) as file:
            for _ in file.iter_batches(columns=["time", "x", "v", "theta"]):
                pass
    else:
        from rosbags.highlevel import AnyReader

        with AnyReader([path]) as bag:
            for connection, _, data in bag.messages():
                bag.deserialize(data, connection.msgtype)


def arguments(path: Path) -> list[str]:
    """The command line of `hprs` that assesses a file."""
    options = BAG_COLUMNS if path.suffix == ".bag" else []
    return ["assess", str(path), "--task", TASK, "--json", *options]


def assess(path: Path) -> None:
    """Assess a file as the command line does."""
    from hprs.cli import main

    with contextlib.redirect_stdout(io.StringIO()):
        assert main(arguments(path)) == 0  # noqa: S101


def measured(what: str, path: Path) -> None:
    """Print seconds and peak memory in MB of one piece of work, in this process."""
    work = {"read": read, "assess": assess}[what]
    warm = path.with_name(f"warm{path.suffix}")
    # All imports, and what is made once.
    work(warm)
    start = time.perf_counter()
    work(path)
    spent = time.perf_counter() - start
    print(json.dumps({"seconds": spent, "peak": peak()}))


def peak() -> float:
    """The most memory that this process has held, in MB.

    Not `ru_maxrss`, which begins with that of the process that started this one.
    """
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def in_a_process(what: str, path: Path) -> dict[str, float]:
    """The best of several measurements, each in a process of its own."""
    call = [sys.executable, __file__, what, str(path)]
    found = [json.loads(subprocess.check_output(call)) for _ in range(REPEATS)]
    return min(found, key=lambda one: one["seconds"])


def command_seconds(path: Path) -> float:
    """Seconds of the whole command, Python's start included."""
    start = time.perf_counter()
    call = [sys.executable, "-m", "hprs", *arguments(path)]
    subprocess.run(call, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def main() -> None:
    """Measure all kinds of files."""
    print(
        f"{'file':>8} {'steps':>10} {'size':>8} {'read':>8} {'assess':>8} {'ratio':>6} "
        f"{'read, peak':>12} {'peak':>8} {'command':>8}"
    )
    with tempfile.TemporaryDirectory() as name:
        for kind in ("csv", "parquet", "bag"):
            folder = Path(name, kind)
            folder.mkdir()
            write(folder, kind, 1_000).rename(folder / f"warm.{kind}")
            for steps in BAG_STEPS if kind == "bag" else STEPS:
                path = write(folder, kind, steps)
                alone, whole = in_a_process("read", path), in_a_process("assess", path)
                print(
                    f"{kind:>8} {steps:>10,} {path.stat().st_size / 1e6:5.1f} MB "
                    f"{alone['seconds']:6.3f} s {whole['seconds']:6.3f} s "
                    f"{whole['seconds'] / alone['seconds']:6.2f} {alone['peak']:9.0f} MB "
                    f"{whole['peak']:5.0f} MB "
                    f"{command_seconds(path):6.2f} s"
                )


if __name__ == "__main__":
    if len(sys.argv) == 3:
        measured(sys.argv[1], Path(sys.argv[2]))
    else:
        main()
