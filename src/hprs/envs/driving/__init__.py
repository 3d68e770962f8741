"""What the driving benchmarks share: cars that learn, as Gymnasium and as JAX functions.

Importing anything of it needs JAX; a missing one is named here, with a hint.
"""

from __future__ import annotations

from hprs.errors import MissingExtraError

try:
    import jax as jax
except ModuleNotFoundError as error:
    if error.name != "jax":
        raise
    raise MissingExtraError("JAX", "jax") from None
