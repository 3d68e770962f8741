"""Writes files so that neither a killed process nor a full disk leaves half of one."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hprs.errors import RunError


@contextmanager
def writing(place: Path, advice: str = "") -> Iterator[None]:
    """Turn the operating system's refusals into one line.

    Args:
        place: What is written, where the system does not say.
        advice: What to do then.

    Raises:
        RunError: The disk is full, the folder is read-only, or alike.
    """
    try:
        yield
    except OSError as error:
        file = error.filename or place
        raise RunError(f"cannot write {file}: {error.strerror or error}.{advice}") from error


def write(path: Path, content: bytes) -> None:
    """Write a file, through to the disk."""
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def replace(path: Path, content: bytes) -> None:
    """Give a file new content: whatever kills the process leaves the old or the new one."""
    fresh = beside(path, "new")
    write(fresh, content)
    fresh.replace(path)
    sync_folder(path.parent)


def append(path: Path, content: bytes) -> None:
    """Add to a file; where that fails, what was added is taken away again."""
    with path.open("ab", buffering=0) as file:
        before = file.tell()
        try:
            added = 0
            while added < len(content):
                added += file.write(content[added:])
            os.fsync(file.fileno())
        except OSError:
            file.truncate(before)
            raise


def checksum(content: bytes) -> str:
    """What `read_checked` compares with."""
    return hashlib.sha256(content).hexdigest()


def read(path: Path) -> bytes:
    """The content of a file.

    Raises:
        RunError: It cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise RunError(f"{path} cannot be read: {error.strerror}.") from None


def read_checked(path: Path, sha256: str) -> bytes:
    """The content of a file that has not changed since its checksum was taken.

    Raises:
        RunError: It cannot be read, or is damaged.
    """
    content = read(path)
    if checksum(content) != sha256:
        raise damaged(path)
    return content


def damaged(path: Path) -> RunError:
    """The error of a file that is not what was written."""
    return RunError(f"{path} is damaged.")


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A new empty folder that takes the place of `target` when the block ends without error.

    The files in it must have been written through to the disk.
    """
    fresh, old = beside(target, "new"), beside(target, "old")
    # A process that died between the two renames left the only whole folder as the old one.
    if target.exists():
        shutil.rmtree(old, ignore_errors=True)
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    yield fresh
    sync_folder(fresh)
    if target.exists():
        target.rename(old)
    fresh.rename(target)
    sync_folder(target.parent)
    shutil.rmtree(old, ignore_errors=True)


def complete(target: Path) -> Path | None:
    """A replaced folder; the old one if the process died between the two renames."""
    return next((path for path in (target, beside(target, "old")) if path.is_dir()), None)


def beside(path: Path, state: str) -> Path:
    """The hidden name under which a file or a folder waits for its turn."""
    return path.with_name(f".{path.name}.{state}")


def sync_folder(folder: Path) -> None:
    """Write a folder's entries through to the disk: a rename is one, so a power cut keeps it."""
    if os.name != "posix":
        return
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
