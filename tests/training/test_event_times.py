"""Seconds of training from the times in TensorBoard files."""

import numpy as np
import pytest

from hprs.training import events
from hprs.training.configure import configure
from hprs.training.event_times import PATTERN, seconds_of
from hprs.training.run_directory import create_runs


@pytest.fixture
def run(tmp_path):
    [run] = create_runs([configure("hprs/CartPole-v0")], tmp_path)
    return run


@pytest.fixture
def clock(monkeypatch):
    """The time of day, in seconds, that events are written at."""
    now = [1000.0]
    monkeypatch.setattr(events.time, "time", lambda: now[0])
    return now


def write(run, clock, began, entries, step=0):
    clock[0] = began
    with events.EventWriter(run, step) as writer:
        for at, time in entries:
            clock[0] = time
            writer.write({"assessment/S": 1.0}, at)


def test_seconds_count_from_the_begin_of_the_file(run, clock):
    write(run, clock, 1000.0, [(0, 1001.0), (100, 1005.0), (300, 1013.0)])
    assert seconds_of(run.path, np.array([0, 100, 200, 300])) == pytest.approx([1, 5, 9, 13])


def test_the_time_between_interruption_and_going_on_is_left_out(run, clock):
    write(run, clock, 1000.0, [(100, 1005.0), (200, 1010.0), (300, 1015.0)])
    # It goes on from step 200, a day later: what was written of step 300 is void.
    write(run, clock, 90_000.0, [(300, 90_004.0)], step=200)
    assert seconds_of(run.path, np.array([100, 200, 300])) == pytest.approx([5, 10, 14])


def test_half_a_record_ends_the_file(run, clock):
    write(run, clock, 1000.0, [(100, 1005.0), (200, 1010.0)])
    [file] = run.path.glob(PATTERN)
    file.write_bytes(file.read_bytes()[:-7])
    assert seconds_of(run.path, np.array([100, 200])) == pytest.approx([5, 5])


def test_without_files_nothing_is_known(run):
    assert np.isnan(seconds_of(run.path, np.array([100, 200]))).all()
