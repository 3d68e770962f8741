import errno
import subprocess
import sys

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from hprs.errors import RunError
from hprs.training.events import EventWriter
from hprs.training.run_directory import create_runs
from tests.training.small import ppo


@pytest.fixture
def run(tmp_path):
    return create_runs([ppo()], tmp_path)[0]


def scalars(run, name):
    return [(found.step, found.value) for found in EventAccumulator(str(run.path)).Reload().Scalars(name)]  # fmt: skip


def test_numbers_are_read_back_by_tensorboard(run):
    with EventWriter(run) as events:
        events.write({"loss": 0.5, "count": 3}, 10)
        events.write({"loss": 0.25}, 20)
        # Without a thread of its own: what is written can be read.
        assert scalars(run, "loss") == [(10, 0.5), (20, 0.25)]
    assert scalars(run, "count") == [(10, 3.0)]


def test_what_was_written_after_the_step_gone_on_from_is_void(run):
    with EventWriter(run) as events:
        for step in (10, 20, 30):
            events.write({"loss": step}, step)
    with EventWriter(run, 20) as events:
        events.write({"loss": 0.0}, 30)
    assert scalars(run, "loss") == [(10, 10.0), (20, 20.0), (30, 0.0)]


def test_a_full_disk_is_one_line(run, monkeypatch):
    from tensorboard.summary.writer import record_writer

    def full(writer, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    events = EventWriter(run)
    monkeypatch.setattr(record_writer.RecordWriter, "write", full)
    with pytest.raises(RunError, match=r"^cannot write .*: No space left on device\. What is"):
        events.write({"loss": 1.0}, 1)
    events.close()


def test_no_trainer_is_imported(run):
    program = (
        "import sys\n"
        "from pathlib import Path\n"
        "from hprs.training.events import EventWriter\n"
        "from hprs.training.run_directory import RunDirectory\n"
        f"with EventWriter(RunDirectory(Path({str(run.path)!r}))) as events:\n"
        "    events.write({'loss': 1.0}, 1)\n"
        "assert not {'torch', 'stable_baselines3', 'jax', 'tensorflow'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr
