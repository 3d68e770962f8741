"""Rows of batches: of observations, reward memories, and Gymnasium's masked info dictionaries."""

from __future__ import annotations

from typing import Any

import numpy as np

from hprs.errors import UsageError
from hprs.semantics.assessment import Tally


def merge_rows(mask: Any, new: Any, old: Any) -> Any:
    """A reward's memory: `new` where the mask holds, `old` elsewhere.

    The batch is the first axis of every array; a number stands for every row.

    Raises:
        UsageError: It holds something else than arrays, numbers, None, dictionaries and tuples.
    """
    if new is None:
        return None
    if isinstance(new, dict):
        return {key: merge_rows(mask, value, old[key]) for key, value in new.items()}
    if isinstance(new, tuple):
        parts = [merge_rows(mask, n, o) for n, o in zip(new, old, strict=True)]
        return type(new)(*parts) if hasattr(new, "_fields") else tuple(parts)
    new, old = np.asarray(new), np.asarray(old)
    for array in (new, old):
        if array.dtype == object or array.shape[:1] not in ((), mask.shape):
            raise UsageError(
                f"the memory of a reward must be made of arrays with the batch ({mask.size} rows) "
                "as first axis, numbers, None, dictionaries and tuples, but it holds "
                f"{f'an array of shape {array.shape}' if array.shape else repr(array.item())}."
            )
    axes = max(new.ndim, old.ndim, 1)
    return np.where(mask.reshape(-1, *[1] * (axes - 1)), new, old)


def merge_tally(mask: Any, new: Tally, old: Tally) -> Tally:
    """`new` where the mask holds, `old` elsewhere; a tally has the batch as its last axis."""
    return Tally(*(np.where(mask, n, o) for n, o in zip(new, old, strict=True)))


def merge_infos(infos: dict[str, Any], added: dict[str, Any], mask: Any) -> dict[str, Any]:
    """Infos with the rows of a mask taken from `added`; each key `k` has its own mask `_k`."""
    merged = dict(infos)
    everywhere = bool(mask.all())
    for key, value in added.items():
        if key.startswith("_") and key[1:] in added:
            continue
        valid = added.get(f"_{key}", mask) & mask
        if key in merged and not isinstance(value, dict) and not everywhere:
            value = _where(mask if valid is mask else valid, value, merged[key])
            valid = valid | merged.get(f"_{key}", False)
        elif isinstance(value, dict):
            value = merge_infos(merged.get(key, {}), value, mask)
            valid = valid | merged.get(f"_{key}", False)
        merged[key], merged[f"_{key}"] = value, valid
    return merged


def without_rows(infos: dict[str, Any], mask: Any) -> dict[str, Any]:
    """Infos in which the rows of a mask count as absent."""
    kept: dict[str, Any] = {}
    for key, value in infos.items():
        if key.startswith("_") and key[1:] in infos:
            continue
        kept[key] = without_rows(value, mask) if isinstance(value, dict) else value
        kept[f"_{key}"] = infos.get(f"_{key}", True) & ~mask
    return kept


def _where(mask: Any, new: Any, old: Any) -> Any:
    merged = np.array(old, dtype=np.result_type(new, old) if old.dtype != object else object)
    merged[mask] = np.asarray(new)[mask]
    return merged


def masked(entries: dict[str, Any], mask: Any) -> dict[str, Any]:
    """Info entries with their masks `_key` beside them."""
    return entries | {f"_{key}": mask for key in entries}


def take_row(batch: Any, row: Any) -> Any:
    """A copy of one row of a batch of observations, dictionaries and tuples included."""
    if isinstance(batch, dict):
        return {key: take_row(value, row) for key, value in batch.items()}
    if isinstance(batch, tuple):
        return tuple(take_row(value, row) for value in batch)
    return np.array(batch[row])


def copy_batch(batch: Any) -> Any:
    """A copy of a batch of observations, dictionaries and tuples included."""
    if isinstance(batch, dict):
        return {key: copy_batch(value) for key, value in batch.items()}
    if isinstance(batch, tuple):
        return tuple(copy_batch(value) for value in batch)
    return np.array(batch)


def set_row(batch: Any, row: Any, value: Any) -> None:
    """Write one row of a batch of observations in place."""
    if isinstance(batch, dict):
        for key, part in batch.items():
            set_row(part, row, value[key])
    elif isinstance(batch, tuple):
        for part, item in zip(batch, value, strict=True):
            set_row(part, row, item)
    else:
        batch[row] = value
