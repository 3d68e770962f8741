"""How a vector environment is made to reset one of its sub-environments."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from hprs.errors import UsageError

Mask: TypeAlias = np.ndarray[Any, np.dtype[np.bool_]]


def forced_reset(envs: VectorEnv[Any, Any, Any]) -> Callable[[Mask], None]:
    """How to reset sub-environments whose episodes the task ended and they would not have.

    `SyncVectorEnv` and `AsyncVectorEnv` take a mask at `reset`; an environment of one's own says
    that it does with `metadata["reset_mask"] = True`. Gymnasium's native vector environments keep a
    flag `prev_done` for the reset that comes with the next step.

    Where only the mask exists and the reset is due with the next step, that step goes to the
    environment too: each of these rows is stepped once more and then reset. Their generators
    (`np_random`) are put back in between, in an `AsyncVectorEnv`; what else a step changes and a
    reset does not undo, such as a generator of the environment's own, remains changed.

    Raises:
        UsageError: This vector environment offers none of these.
    """
    bare: Any = envs.unwrapped
    mode = envs.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
    if isinstance(bare, SyncVectorEnv) and mode == AutoresetMode.NEXT_STEP:
        return lambda mask: _flag(bare._autoreset_envs, mask)
    next_step = mode == AutoresetMode.NEXT_STEP
    if isinstance(bare, AsyncVectorEnv) and next_step and not bare.shared_memory:
        # There, Gymnasium 1.4 forgets to call off its own reset when it is asked for one.
        raise UsageError(
            "the task ends episodes, but AsyncVectorEnv(shared_memory=False) in autoreset mode "
            "NEXT_STEP resets such sub-environments twice. Use shared_memory=True, or another mode."
        )
    if isinstance(bare, SyncVectorEnv | AsyncVectorEnv) or bare.metadata.get("reset_mask"):
        return reset_by_mask
    if isinstance(getattr(bare, "prev_done", None), np.ndarray) and mode == AutoresetMode.NEXT_STEP:
        return lambda mask: _flag(bare.prev_done, mask)
    raise UsageError(
        f"the task ends episodes, but {type(bare).__name__} cannot reset single sub-environments. "
        "Use gymnasium.make_vec(..., vectorization_mode='sync'), or autoreset mode DISABLED, or "
        "pass end_on_violation=False and end_on_target=False."
    )


def reset_by_mask(mask: Mask) -> None:
    """A marker: the wrapper calls `reset` with the mask itself, when the next step is due."""


def _flag(flags: Mask, mask: Mask) -> None:
    flags |= mask
