"""How long a car's loop takes to decide, and how much memory it holds.

    .venv/bin/python benchmarks/latency.py

One decision is all that a tick does: 1,080 readings are resampled, the history is stacked, the
policy acts, everything is checked and logged. It runs on one core, in a process that imports what
the car does, once alone and once beside a second process that computes without end. Each line is
the best of 5 runs of 5,000 decisions. Run it on a machine that does nothing else.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import math
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RUNS, DECISIONS, WARM_UP = 5, 5_000, 200
BUNDLE = Path(__file__).parents[1] / "results/ppo/safedriving/hprs-paper-seed-0.bundle"
ENVIRONMENT = "hprs/SafeDriving-v0"
BUSY = "while True: sum(range(1000))"


def measured(bundle: str) -> dict[str, float]:
    """Milliseconds of decisions, and the memory of this process in MB."""
    from hprs.deploy import load_bundle
    from hprs.deploy.loop import DRIVING, ControlLoop, Limits
    from hprs.deploy.record import Record
    from hprs.deploy.scan import Scan

    forever = float("inf")
    plain = ControlLoop(load_bundle(bundle), dead_man=False)
    limits = Limits(scan_age=forever, odometry_age=forever, decision=forever, tick=forever)
    found = []
    rng = np.random.default_rng(0)
    scans = [rng.uniform(0.5, 9.0, 1080).astype(np.float32) for _ in range(50)]
    for scan in scans:
        scan[rng.integers(0, 1080, 20)] = math.nan
    for number in range(RUNS):
        log = Record(f"{bundle}.{number}.csv", plain.monitor.signals, plain.monitor.labels)
        loop = ControlLoop(load_bundle(bundle), dead_man=False, limits=limits, record=log)
        taken = []
        for tick in range(WARM_UP + DECISIONS):
            scan = scans[tick % len(scans)]
            loop.hear_scan(Scan(scan, -math.radians(135), math.radians(270) / 1079, 0.06, 10.0))
            loop.hear_speed(1.5)
            start = time.perf_counter()
            drive = loop.tick()
            taken.append(time.perf_counter() - start)
            if drive.phase != DRIVING:
                raise SystemExit(f"the loop {drive.phase}: {drive.reason}")
        loop.close()
        found.append(np.quantile(taken[WARM_UP:], (0.5, 0.999)) * 1e3)
    median, last = np.min(found, axis=0)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"median": float(median), "99.9th": float(last), "memory": memory}


def main() -> None:
    """Print a table."""
    if len(sys.argv) > 1:
        print(json.dumps(measured(sys.argv[1])))
        return
    with tempfile.TemporaryDirectory() as folder:
        bundle = Path(folder) / "policy.bundle"
        export = [str(BUNDLE), str(bundle), "--environment", ENVIRONMENT]
        subprocess.run(
            [sys.executable, "-m", "hprs", "export", *export],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        print("                     median    99.9th    largest memory")
        for title in ("alone", "beside a busy one"):
            busy = None
            if title != "alone":
                busy = subprocess.Popen([sys.executable, "-c", BUSY])
            try:
                own = Path(folder) / title
                own.mkdir()
                copy = own / "policy.bundle"
                copy.write_bytes(bundle.read_bytes())
                done = subprocess.run(
                    [sys.executable, __file__, str(copy)],
                    check=True,
                    capture_output=True,
                    text=True,
                )
            finally:
                if busy is not None:
                    busy.kill()
                    busy.wait()
            row = json.loads(done.stdout)
            print(
                f"{title:19} {row['median']:6.3f} ms {row['99.9th']:6.3f} ms "
                f"{row['memory']:10.0f} MB"
            )


if __name__ == "__main__":
    main()
