"""A recorded log, assessed afterwards: as CSV, as Parquet, and as a rosbag of ROS 2.

    python examples/recorded_log.py --out logs

Needs `pip install 'hprs[classic,parquet,ros]'`. It records one episode, writes it in three forms,
and assesses each by `hprs assess`. Every requirement is measured or, where the log lacks a signal,
unknown; PAM is shown where all are measured.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path
from typing import Any

import gymnasium as gym
import pyarrow
from pyarrow import parquet
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

from hprs.cli import main as hprs

TASK = Path(__file__).with_name("pendulum.hprs")
TIME_STEP = 0.05


def record(steps: int) -> list[dict[str, float]]:
    """What a robot would log at its policy's ticks, s_0 first: signals, and the action before."""
    env = gym.make("Pendulum-v1")
    observation, _ = env.reset(seed=0)
    rows, torque = [], 0.0
    for tick in range(steps + 1):
        height, spin = float(observation[0]), float(observation[2])
        rows.append({"time": tick * TIME_STEP, "height": height, "spin": spin, "torque": torque})
        torque = 2.0 if spin >= 0 else -2.0
        observation, *_ = env.step([torque])
    return rows


def write_csv(path: Path, rows: list[dict[str, float]]) -> None:
    """One row a tick, columns named as signals."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def write_bag(path: Path, rows: list[dict[str, float]]) -> None:
    """Sensors, and the policy's command a millisecond after it has seen them."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    number = "std_msgs/msg/Float64"

    def message(value: float) -> Any:
        return store.serialize_cdr(store.types[number](data=value), number)

    with Writer(path, version=9) as bag:
        topics = {
            name: bag.add_connection(name, number, typestore=store)
            for name in ("/height", "/spin", "/command")
        }
        # The torque of a row is the command of the tick before it.
        commands = [row["torque"] for row in rows[1:]] + [0.0]
        for row, command in zip(rows, commands, strict=True):
            stamp = round((1 + row["time"]) * 1e9)
            bag.write(topics["/height"], stamp, message(row["height"]))
            bag.write(topics["/spin"], stamp, message(row["spin"]))
            bag.write(topics["/command"], stamp + 1_000_000, message(command))


def main() -> None:
    """Record, write and assess."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--out", type=Path, default=Path("runs/recorded_log"))
    options = parser.parse_args()
    out = options.out
    if out.exists():
        parser.error(f"{out} exists already.")
    out.mkdir(parents=True)

    rows = record(options.steps)
    write_csv(out / "log.csv", rows)
    parquet.write_table(pyarrow.Table.from_pylist(rows), out / "log.parquet")
    write_bag(out / "bag", rows)
    write_csv(out / "no_spin.csv", [{k: v for k, v in row.items() if k != "spin"} for row in rows])

    task = ["--task", str(TASK)]
    commands = [
        ["assess", str(out / "log.csv"), *task],
        ["assess", str(out / "log.parquet"), *task],
        [
            *["assess", str(out / "bag"), *task, "--ticks", "/command"],
            *["--column", "torque=/command.data"],
        ],
        ["assess", str(out / "no_spin.csv"), *task, "--missing", "unknown"],
    ]
    for command in commands:
        print(f"\n$ hprs {' '.join(command)}\n", flush=True)
        if hprs(command):
            raise SystemExit(1)


if __name__ == "__main__":
    main()
