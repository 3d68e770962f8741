"""NumPy arrays by name as the content of a file, without pickles."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np


def pack(arrays: Mapping[str, np.ndarray]) -> bytes:
    """The content of an `.npz` file."""
    content, named = io.BytesIO(), dict[str, Any](arrays)
    np.savez(content, **named)
    return content.getvalue()


def unpack(content: bytes) -> dict[str, np.ndarray]:
    """The inverse of `pack`; an array of objects is refused."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}
