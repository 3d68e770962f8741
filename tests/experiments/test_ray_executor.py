"""Grids over Ray: the same numbers as without it, and nothing lost with a worker or a node."""

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

pytest.importorskip("ray")

SMALL = """
[defaults]
steps = 2_048
evaluate_every = 1_024
seeds = 2
set = { environments = 2, n_steps = 512, batch_size = 64, n_epochs = 1, net_arch = [4] }

[[runs]]
environment = "hprs/CartPole-v0"
"""
LONG = """
[defaults]
steps = 400_000
evaluate_every = 20_000
seeds = 4

[[runs]]
environment = "hprs/CartPole-v0"
"""


@pytest.fixture
def grid(tmp_path):
    def write(text):
        (tmp_path / "grid.toml").write_text(text)
        return tmp_path

    return write


@contextmanager
def started(folder, *arguments, out="runs"):
    command = [sys.executable, "-m", "hprs", "benchmark", "grid.toml", "--out", out, *arguments]
    process = subprocess.Popen(
        command, cwd=folder, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def trained(folder, *arguments, out="runs"):
    with started(folder, *arguments, out=out) as process:
        printed, _ = process.communicate()
    return process.returncode, printed


def tables(folder):
    """Of every run its evaluations."""
    found = {
        path.parent.name: path.read_text() for path in folder.glob("*/*/seed-*/evaluations.csv")
    }
    assert found
    return found


def busy(folder):
    """The processes that train runs which have been evaluated after their first step."""
    found = []
    for lock in folder.glob("*/*/seed-*/.lock"):
        lines = (lock.parent / "evaluations.csv").read_text().splitlines()
        if len({line.partition(",")[0] for line in lines}) > 2 and (pid := running(lock)):
            found.append(pid)
    return found


def running(lock):
    """The process that holds a lock; None if there is none any more."""
    with suppress(ProcessLookupError, ValueError):
        pid = int(lock.read_text())
        os.kill(pid, 0)
        return pid
    return None


def wait_for(condition, seconds=240.0):
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline
        time.sleep(0.1)
    return found


def test_a_grid_on_a_ray_of_this_machine_gives_the_numbers_of_processes(grid):
    folder = grid(SMALL)
    code, printed = trained(folder, "--ray", "local")
    assert code == 0, printed
    assert "2 of 2 runs are done, in runs.\n" in printed
    assert printed.count("from step 0 of 2,048") == 2
    assert trained(folder, "--workers", "1", out="again")[0] == 0
    assert tables(folder / "runs") == tables(folder / "again")
    # What is done is not begun: no cluster is needed for it.
    code, printed = trained(folder, "--ray", "localhost:1")
    assert (code, "All 2 runs are done." in printed) == (0, True)


def test_an_address_without_a_cluster_is_refused_at_once(grid):
    code, printed = trained(grid(SMALL), "--ray", "localhost:1")
    assert code == 2
    assert "hprs: There is no Ray cluster at 'localhost:1'" in printed
    assert "`ray start --head`" in printed


@pytest.mark.soak
@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_a_run_whose_worker_is_killed_goes_on(grid):
    folder = grid(LONG.replace("seeds = 4", "seeds = 1"))
    with started(folder, "--ray", "local") as process:
        [pid] = wait_for(lambda: busy(folder / "runs"))
        os.kill(pid, signal.SIGKILL)
        printed, _ = process.communicate()
    assert process.returncode == 0, printed
    assert re.search(r"its worker was lost; another goes on from step [1-9]", printed)
    assert trained(folder, "--workers", "1", out="again")[0] == 0
    assert tables(folder / "runs") == tables(folder / "again")


@pytest.mark.soak
@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL")
def test_a_node_that_is_killed_in_the_middle_of_a_grid_loses_nothing(grid):
    folder = grid(LONG)
    cluster = subprocess.Popen(
        [sys.executable, "-m", "tests.experiments.two_nodes"],
        cwd=Path(__file__).parents[2], text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        address = cluster.stdout.readline().strip()
        with started(folder, "--ray", address) as process:
            wait_for(lambda: len(busy(folder / "runs")) == 2)
            cluster.stdin.write("kill\n")
            cluster.stdin.flush()
            assert cluster.stdout.readline() == "killed\n"
            printed, _ = process.communicate()
    finally:
        cluster.communicate()
    assert process.returncode == 0, printed
    assert "4 of 4 runs are done, in runs.\n" in printed
    # Each was begun once; the one of the lost node went on, at the other one.
    assert printed.count("from step 0 of 400,000") == 4
    assert len(re.findall(r"its worker was lost; another goes on from step [1-9]", printed)) == 1
    assert trained(folder, out="again")[0] == 0
    assert tables(folder / "runs") == tables(folder / "again")


@pytest.mark.soak
@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGINT")
def test_ctrl_c_saves_the_states_and_the_same_command_goes_on(grid):
    folder = grid(LONG)
    with started(folder, "--ray", "local") as process:
        wait_for(lambda: busy(folder / "runs"))
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate()
    assert process.returncode == 130, printed
    assert "Stopping as soon as the states can be saved" in printed
    assert trained(folder, "--ray", "local")[0] == 0
    assert trained(folder, out="again")[0] == 0
    assert tables(folder / "runs") == tables(folder / "again")
