import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from hprs.training.crew import worker_environment
from hprs.training.listener import Silence
from hprs.training.population import train_population
from hprs.training.run_directory import create_runs
from tests.training.small import configure_sb3
from tests.training.stub import alive, configuration, find_stub, read, wait_for

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    """Worker processes import the stub."""
    monkeypatch.syspath_prepend(ROOT)


class Notes(Silence):
    """Listens to one member."""

    def __init__(self, heard, run):
        self.heard, self.name = heard, run.path.name

    def started(self, configuration, step):
        self.heard.append((self.name, "started", configuration.seed, step))

    def advanced(self, step):
        self.heard.append((self.name, "advanced", step))

    def evaluated(self, step, summary):
        self.heard.append((self.name, "evaluated", step, summary.pam))

    def ended(self):
        self.heard.append((self.name, "ended"))


class Notebook:
    """Listens to a population."""

    def __init__(self):
        self.heard, self.outcomes, self.asked = [], [], 0

    def member(self, run):
        return Notes(self.heard, run)

    def settled(self, outcome):
        self.outcomes.append(outcome)

    def stopping(self):
        self.asked += 1


def population(folder, *acts, **parameters):
    return create_runs([configuration(seed, act, **parameters) for seed, act in enumerate(acts)], folder)  # fmt: skip


def states(outcomes):
    return [outcome.state for outcome in outcomes]


def train(runs, workers, notes=None):
    return train_population(runs, notes or Notebook(), workers=workers, find_trainer=find_stub)


def interrupt_when(condition, number=signal.SIGINT):
    """Presses Ctrl-C when something is so."""

    def press():
        wait_for(condition)
        os.kill(os.getpid(), number)

    thread = threading.Thread(target=press)
    thread.start()
    return thread


def test_members_are_trained_side_by_side_in_processes_of_their_own(tmp_path):
    runs, notes = population(tmp_path, "meet", "meet"), Notebook()
    outcomes = train(runs, 2, notes)
    assert [outcome.run for outcome in outcomes] == runs
    assert states(outcomes) == ["complete"] * 2
    pids = {read(run)["pid"] for run in runs}
    assert len(pids) == 2
    assert os.getpid() not in pids
    assert not any(alive(pid) for pid in pids)


def test_a_worker_has_a_core_of_its_own_and_no_threads(tmp_path, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=true")
    runs = population(tmp_path, "meet", "meet")
    train(runs, 2)
    found = [read(run) for run in runs]
    ours = sorted(os.sched_getaffinity(0))
    assert sorted(core for member in found for core in member["cores"]) == sorted(
        ours[i % len(ours)] for i in range(2)
    )
    assert [member["threads"] for member in found] == ["1", "1"]
    wanted = "--xla_cpu_multi_thread_eigen=true intra_op_parallelism_threads=1"
    assert [member["flags"] for member in found] == [wanted] * 2
    assert "OMP_NUM_THREADS" not in os.environ
    assert os.environ["XLA_FLAGS"] == "--xla_cpu_multi_thread_eigen=true"


def test_what_is_set_for_threads_stays():
    assert worker_environment({}) == {
        "OMP_NUM_THREADS": "1",
        "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    }
    assert worker_environment({"OMP_NUM_THREADS": "4"})["OMP_NUM_THREADS"] == "4"


def test_who_wants_several_threads_is_bound_to_no_core(tmp_path):
    runs = population(tmp_path, "finish", "finish", threads=2)
    train(runs, 2)
    assert all(read(run)["cores"] == sorted(os.sched_getaffinity(0)) for run in runs)


def test_a_process_trains_one_member_after_the_other(tmp_path):
    runs, notes = population(tmp_path, *["finish"] * 5), Notebook()
    assert states(train(runs, 2, notes)) == ["complete"] * 5
    assert len({read(run)["pid"] for run in runs}) <= 2
    for seed, run in enumerate(runs):
        name = run.path.name
        assert [event for event in notes.heard if event[0] == name] == [
            (name, "started", seed, 0),
            (name, "advanced", 50),
            (name, "evaluated", 100, 1.25),
            (name, "ended"),
        ]


@pytest.mark.parametrize("workers", [1, 2])
def test_a_member_that_diverges_does_not_stop_the_others(tmp_path, workers):
    runs, notes = population(tmp_path, "diverge", "finish", "diverge", "finish"), Notebook()
    outcomes = train(runs, workers, notes)
    assert states(outcomes) == ["failed", "complete"] * 2
    assert outcomes[0].text == "the training diverged before step 50."
    assert sorted(notes.outcomes, key=lambda o: o.run.path.name) == outcomes


def test_a_process_that_is_killed_is_replaced(tmp_path):
    runs = population(tmp_path, "die", "finish", "die", "finish", "finish")
    outcomes = train(runs, 2)
    assert states(outcomes) == ["failed", "complete", "failed", "complete", "complete"]
    assert outcomes[0].text == "its process was killed (SIGKILL)."


def test_a_fault_of_ours_ends_its_member_only(tmp_path, capfd):
    outcomes = train(population(tmp_path, "crash", "finish", "finish"), 2)
    assert states(outcomes) == ["failed", "complete", "complete"]
    assert outcomes[0].text == "its process ended with code 1."
    assert "ValueError: a fault" in capfd.readouterr().err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_stops_every_member_where_its_state_is_whole(tmp_path, number):
    runs, notes = population(tmp_path, "stay", "stay", "finish", "finish"), Notebook()
    before = signal.getsignal(number)
    both = [run.path / "listening" for run in runs[:2]]
    thread = interrupt_when(lambda: all(file.exists() for file in both), number)
    outcomes = train(runs, 2, notes)
    thread.join()
    assert states(outcomes) == ["interrupted"] * 4
    assert notes.asked == 1
    assert all((run.path / "stopped").exists() for run in runs[:2])
    assert not any((run.path / "begun").exists() for run in runs[2:])
    assert signal.getsignal(number) is before
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


def test_a_second_ctrl_c_stops_at_once(tmp_path):
    runs, notes = population(tmp_path, "idle", "idle"), Notebook()
    both = [run.path / "listening" for run in runs]
    threads = [interrupt_when(lambda: all(file.exists() for file in both)), interrupt_when(lambda: notes.asked)]  # fmt: skip
    assert states(train(runs, 2, notes)) == ["interrupted"] * 2
    for thread in threads:
        thread.join()
    assert not any(alive(read(run, "listening")["pid"]) for run in runs)


def test_without_processes_ctrl_c_stops_the_members_that_would_follow(tmp_path):
    runs = population(tmp_path, "finish", "stay", "finish")
    thread = interrupt_when((runs[1].path / "listening").exists)
    outcomes = train(runs, 1)
    thread.join()
    assert states(outcomes) == ["complete", "interrupted", "interrupted"]
    assert read(runs[0])["pid"] == os.getpid()
    assert not (runs[2].path / "begun").exists()


PARENT = """
import sys
from pathlib import Path
from hprs.training.population import train_population
from hprs.training.run_directory import find_runs
from tests.training.stub import find_stub
from tests.training.test_population import Notebook

if __name__ == "__main__":
    runs = find_runs(Path(sys.argv[1]))
    train_population(runs, Notebook(), workers=2, find_trainer=find_stub)
"""


@pytest.fixture
def parent(tmp_path):
    """Trains two members in processes of a process that can be killed."""
    runs = population(tmp_path, "stay", "stay")
    program = tmp_path / "parent.py"
    program.write_text(PARENT)
    command = [sys.executable, str(program), str(runs[0].path.parent)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        wait_for(lambda: all((run.path / "listening").exists() for run in runs))
        yield process, runs
        process.kill()


def test_nobody_trains_on_for_a_process_that_was_killed(parent):
    process, runs = parent
    process.kill()
    wait_for(lambda: not any(alive(read(run, "listening")["pid"]) for run in runs))
    assert all((run.path / "stopped").exists() for run in runs)


def test_ctrl_c_on_a_terminal_reaches_the_members_once(parent):
    """A terminal sends the signal to every process of the foreground group."""
    process, runs = parent
    os.killpg(process.pid, signal.SIGINT)
    _, errors = process.communicate()
    assert (process.returncode, errors) == (0, "")
    assert all((run.path / "stopped").exists() for run in runs)


def test_a_population_of_stable_baselines3_gives_the_numbers_of_single_runs(tmp_path):
    small = {"environments": 2, "n_steps": 16, "batch_size": 16, "n_epochs": 1, "net_arch": [4]}
    made = [
        configure_sb3(
            "hprs/CartPole-v0", settings=small, seed=seed, steps=64, evaluation_interval=32,
            evaluation_episodes=1,
        )
        for seed in range(2)
    ]  # fmt: skip
    tables = []
    for workers in (1, 2):
        runs = create_runs(made, tmp_path / str(workers))
        assert states(train_population(runs, Notebook(), workers=workers)) == ["complete"] * 2
        tables.append([(run.path / "evaluations.csv").read_text() for run in runs])
    assert tables[0] == tables[1]
