"""Every fault ends in one clear line, and nothing that was recorded is lost."""

import errno
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import filelock
import pytest
import torch

from hprs.errors import RunError
from hprs.training import files, run_directory, sb3
from hprs.training.listener import Silence
from hprs.training.lock import LOCK_FILE, locked
from hprs.training.run_directory import RunDirectory, create_runs
from hprs.training.sb3 import training as training_module

from .small import Interrupter, configure_sb3, off_policy, ppo, same_numbers, table


def training(folder, configuration=None):
    [run] = create_runs([configuration or ppo(steps=288)], folder)
    return run


@pytest.fixture
def stopped(tmp_path):
    """A training with a replay buffer that was stopped by Ctrl-C."""
    run = training(tmp_path, off_policy(tmp_path))
    assert not sb3.train(run, Interrupter(100))
    return run


def refusal(run, listener=None):
    with pytest.raises(RunError) as error:
        sb3.train(run, listener)
    text = str(error.value)
    assert "\n" not in text
    return text


def test_a_full_disk_at_any_write_is_one_line_and_the_training_goes_on_later(tmp_path, monkeypatch):
    """A writer that fails every seventh time, until the training has come to its end."""
    whole = training(tmp_path / "whole", off_policy(tmp_path))
    assert sb3.train(whole)
    run = training(tmp_path / "full", off_policy(tmp_path))
    sync, left, faults = os.fsync, 4, 0

    def full(number):
        nonlocal left
        left -= 1
        if left < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync(number)

    monkeypatch.setattr(os, "fsync", full)
    complete, recorded = False, ""
    while not complete:
        try:
            complete = sb3.train(run)
        except RunError as error:
            assert str(error) == (
                f"cannot write {run.path}: No space left on device. What is recorded is safe; "
                f"go on with: hprs train --resume {run.path}"
            )
            faults += 1
        assert table(run).startswith(recorded)
        assert table(run).endswith("\n")
        recorded, left = table(run), 7 + faults
    assert faults > 3
    assert same_numbers(whole, run)


def test_a_limit_on_the_size_of_files_is_one_line(tmp_path):
    resource = pytest.importorskip("resource")
    run = training(tmp_path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, before[1]))
    try:
        text = refusal(run)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert text.startswith(f"cannot write {run.path}: File too large. What is recorded is safe;")
    assert sb3.train(run)


def test_a_row_that_did_not_fit_is_taken_away_again(tmp_path):
    resource = pytest.importorskip("resource")
    file = tmp_path / "table.csv"
    file.write_text("header\n")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            files.append(file, b"x" * 2000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert file.read_text() == "header\n"


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 256 KiB, where one may be mounted."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("nothing may be mounted here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_real_full_disk_is_one_line_and_the_training_goes_on_later(tmp_path, small_disk):
    whole = training(tmp_path)
    assert sb3.train(whole)
    run = training(small_disk)
    ballast = small_disk / "ballast"
    for size in (200_000, 150_000, 60_000):
        ballast.write_bytes(b"x" * size)
        assert "No space left on device" in refusal(run)
        ballast.unlink()
    assert sb3.train(run)
    assert same_numbers(whole, run)


def test_tensorboard_on_a_full_disk_is_one_line(tmp_path, monkeypatch):
    from tensorboard.summary.writer import record_writer

    run = training(tmp_path)
    write = record_writer.RecordWriter.write

    def full(writer, data):
        if b"assessment/PAM" in data:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(writer, data)

    monkeypatch.setattr(record_writer.RecordWriter, "write", full)
    assert "No space left on device" in refusal(run)
    assert len(run.evaluations()) == 2
    monkeypatch.undo()
    assert sb3.train(run)


def test_no_run_is_made_on_a_full_disk(tmp_path, monkeypatch):
    def full(number):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(RunError, match=r"^cannot write .*: No space left on device\.$"):
        training(tmp_path)
    monkeypatch.undo()
    assert sb3.train(training(tmp_path))


def parts(run):
    return [*(run.path / "checkpoint").iterdir(), *(run.path / "replay").iterdir()]


def test_a_checkpoint_has_the_parts_that_the_next_tests_damage(stopped):
    assert sorted(part.name for part in parts(stopped)) == [
        "arrays.npz", "manifest.json", "model.zip", "rows-0-50.npz", "state.json",
    ]  # fmt: skip


@pytest.mark.parametrize("fault", ["missing", "empty", "truncated", "flipped"])
def test_a_damaged_checkpoint_is_never_loaded(stopped, fault):
    before, chance = table(stopped), random.Random(0)
    for part in parts(stopped) * (8 if fault == "flipped" else 1):
        content = part.read_bytes()
        if fault == "missing":
            part.unlink()
        elif fault == "flipped":
            place = chance.randrange(len(content))
            flipped = content[place] ^ (1 << chance.randrange(8))
            part.write_bytes(content[:place] + bytes([flipped]) + content[place + 1 :])
        else:
            part.write_bytes(content[: len(content) // 2 if fault == "truncated" else 0])
        text = refusal(stopped)
        wrong = (
            "cannot be read: No such file or directory." if fault == "missing" else "is damaged."
        )
        assert text.startswith(f"{part} {wrong} This training cannot go on; ")
        assert f"(hprs evaluate {stopped.path})" in text
        part.write_bytes(content)
    assert table(stopped) == before
    assert sb3.train(stopped)


def test_a_checkpoint_that_is_gone_ends_in_one_line_and_nothing_else_goes(stopped):
    shutil.rmtree(stopped.path / "checkpoint")
    before = table(stopped)
    for _ in range(2):
        assert refusal(stopped).startswith(f"{stopped.path / 'checkpoint'} is missing. This ")
    assert table(stopped) == before
    assert sb3.load_policy(stopped, "last") is not None


class Poison(Silence):
    """Makes a weight NaN after a number of steps; with `stop`, presses Ctrl-C as well."""

    def __init__(self, monkeypatch, step, *, stop):
        self.step, self.stop, self.model = step, stop, None
        made = training_module.open_model

        def open_model(*arguments):
            self.model, restoration = made(*arguments)
            return self.model, restoration

        monkeypatch.setattr(training_module, "open_model", open_model)

    def advanced(self, step):
        if step >= self.step and self.model is not None:
            with torch.no_grad():
                next(iter(self.model.policy.parameters())).fill_(float("nan"))
            if self.stop:
                os.kill(os.getpid(), signal.SIGINT)
            self.model = None


@pytest.mark.parametrize("stop", [False, True], ids=["evaluated", "ctrl-c"])
@pytest.mark.parametrize("algorithm", ["dqn", "td3", "ppo", "sac"])
def test_networks_that_end_in_nan_are_one_line_and_are_not_saved(
    tmp_path, monkeypatch, algorithm, stop
):
    if algorithm in ("dqn", "ppo"):
        configuration = configure_sb3(
            "hprs/CartPole-v0", algorithm=algorithm, steps=96, evaluation_interval=32,
            evaluation_episodes=1, settings={"environments": 2, "net_arch": [8]}
            | ({"n_steps": 16, "batch_size": 32} if algorithm == "ppo" else {}),
        )  # fmt: skip
    else:
        configuration = off_policy(tmp_path, algorithm, evaluation_episodes=1)
    run = training(tmp_path, configuration)
    text = refusal(run, Poison(monkeypatch, 40, stop=stop))
    assert text.startswith("the training diverged before step ")
    assert text.endswith(
        ": its networks hold NaN or infinity. A smaller learning_rate is the first thing to try."
    )
    saved = run.checkpoint().progress
    assert saved.step < 40
    assert {row["step"] for row in run.evaluations()} == {0, saved.evaluated}
    assert all(w.isfinite().all() for w in sb3.load_policy(run, "last").model.policy.parameters())


def test_two_processes_do_not_train_one_run(stopped):
    with stopped.locked():
        assert refusal(stopped) == (
            f"{stopped.path} is being trained by another process ({os.getpid()})."
        )
    assert sb3.train(stopped)


DIES_WITH_THE_LOCK = """
import os, sys
from pathlib import Path
from hprs.training.run_directory import RunDirectory
RunDirectory(Path(sys.argv[1])).locked().__enter__()
print(os.getpid(), flush=True)
os._exit(0)
"""


def test_the_lock_vanishes_with_its_process(stopped):
    # Not a fork: JAX, where another test has loaded it, survives none.
    command = [sys.executable, "-c", DIES_WITH_THE_LOCK, str(stopped.path)]
    child = subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    assert (stopped.path / ".lock").read_text() == child
    assert sb3.train(stopped)


@pytest.fixture
def read_only():
    """A folder that is made read-only by calling what this gives, also for root."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    changed = []

    def lock():
        for path in [folder, *folder.rglob("*")]:
            path.chmod(0o555 if path.is_dir() else 0o444)
        if os.geteuid() == 0:
            os.seteuid(65534)
            changed.append(True)

    yield folder, lock
    if changed:
        os.seteuid(0)
    for path in [folder, *folder.rglob("*")]:
        path.chmod(0o755)
    shutil.rmtree(folder)


def test_a_read_only_run_can_be_read_and_not_be_trained(read_only, monkeypatch):
    # Whoever may not write here may not be allowed to enter the project's folder either.
    monkeypatch.setattr(run_directory, "provenance", dict)
    folder, lock = read_only
    run = training(folder)
    assert not sb3.train(run, Interrupter(100))
    lock()
    run = RunDirectory(run.path)
    assert refusal(run).startswith(f"cannot write {run.path / '.lock'}: Permission denied.")
    assert len(run.evaluations()) >= 4
    assert sb3.load_policy(run, "last") is not None
    with pytest.raises(RunError, match=r"^cannot write .*: Permission denied\.$"):
        training(folder / "new", run.configuration)


def test_a_holder_that_has_not_yet_written_who_it_is_is_waited_for(tmp_path):
    with filelock.FileLock(tmp_path / LOCK_FILE):
        late = threading.Timer(0.1, (tmp_path / LOCK_FILE).write_text, ["123"])
        late.start()
        with pytest.raises(RunError, match=r"by another process \(123\)"), locked(tmp_path):
            pass
        late.join()
