"""What a population will need in memory, before anything is made."""

from __future__ import annotations

from pathlib import Path

import jax

from hprs.errors import UsageError
from hprs.training.frames import Frames
from hprs.training.sac.buffer import bytes_of_row
from hprs.training.sac.settings import Settings

SHARE = 0.9
"""Of the free memory that may be used."""


def transitions(settings: Settings, frames: Frames, outputs: int) -> int:
    """Bytes of all that one member remembers."""
    capacity = settings.buffer_size // settings.environments
    return capacity * settings.environments * bytes_of_row(frames, outputs)


def free() -> int | None:
    """Bytes that are free where JAX computes; None if it cannot be known."""
    device = jax.devices()[0]
    if device.platform == "cpu":
        return _available()
    found = device.memory_stats()
    return None if found is None else found["bytes_limit"] - found["bytes_in_use"]


def require_room(member: int, others: int, members: int) -> str:
    """What a population needs, as a line.

    Args:
        member: Bytes of a member's transitions.
        others: Bytes of all else that a member has.
        members: How many.

    Raises:
        UsageError: They do not fit; the message says how many, or how large a buffer, would.
    """
    needed, there = members * (member + others), free()
    text = f"{_shown(needed)} of memory, {_shown(member)} a member for its transitions"
    if there is None or needed <= SHARE * there:
        return text
    fitting = int(SHARE * there) // (member + others)
    share = max(0.0, (SHARE * there / members - others) / member)
    raise UsageError(
        f"{members} members at once need {text}; {_shown(there)} are free. {fitting} of them would "
        f"fit, or all of them with a buffer_size of {share:.0%} of what it is."
    )


def _available() -> int | None:
    """What Linux would give to a new process, caches included; elsewhere it is not known."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    found = [line.split()[1] for line in lines if line.startswith("MemAvailable:")]
    return 1024 * int(found[0]) if found else None


def _shown(number: float) -> str:
    for unit in ("bytes", "KiB", "MiB"):
        if number < 1024:
            return f"{number:,.0f} {unit}"
        number /= 1024
    return f"{number:,.1f} GiB"
