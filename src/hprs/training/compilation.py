"""JAX set up for training: compiled programs are kept from one process to the next."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import jax

_LARGEST = 2**30
"""Bytes that are kept; with a limit JAX also lets no two processes write at once."""
CACHE_VARIABLE = "HPRS_CACHE"
"""Environment variable: where compiled programs are kept, or `off`."""


@cache
def keep_compiled_programs() -> None:
    """Let JAX keep what it compiles; what the user has set himself stays."""
    if getattr(jax.config, "jax_compilation_cache_dir", None):
        return
    chosen = os.environ.get(CACHE_VARIABLE, "")
    if chosen == "off":
        return
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    folder = Path(chosen or Path(home, "hprs", "xla")).expanduser()
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_compilation_cache_max_size", _LARGEST)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
