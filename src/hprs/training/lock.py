"""Keeps two processes from writing one run directory."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hprs.errors import RunError
from hprs.training import files
from hprs.training.environment import require

LOCK_FILE = ".lock"


@contextmanager
def locked(folder: Path, advice: str = "", *, patience: float = 0.0) -> Iterator[None]:
    """Keep other processes out of a run; the lock vanishes with the process.

    Args:
        folder: The run's folder.
        advice: What to do where the lock cannot be written.
        patience: Seconds to wait for another process to leave.

    Raises:
        RunError: Another process is there, or the folder cannot be written.
    """
    filelock = require("filelock", "jax")
    file = folder / LOCK_FILE
    lock = filelock.FileLock(file, timeout=patience)
    with files.writing(folder, advice):
        try:
            lock.acquire()
        except filelock.Timeout:
            raise RunError(f"{folder} is being trained by {_holder(file)}.") from None
    try:
        # Where a lock keeps others from writing its file, it keeps us too.
        with suppress(OSError):
            file.write_text(str(os.getpid()))
        yield
    finally:
        lock.release()


def _holder(file: Path) -> str:
    # Who has just taken the lock has not yet written who it is.
    for _ in range(25):
        with suppress(OSError, ValueError):
            return f"another process ({int(file.read_text())})"
        time.sleep(0.02)
    return "another process"
