"""Rows of batches: of observations, reward memories, and Gymnasium's masked info dictionaries."""

from __future__ import annotations

from typing import Any

import numpy as np


def merge_rows(mask: Any, new: Any, old: Any) -> Any:
    """`new` where the mask holds and `old` elsewhere; the batch is the last axis of every array."""
    if new is None or (isinstance(new, int | float) and not isinstance(old, np.ndarray)):
        return new
    if isinstance(new, dict):
        return {key: merge_rows(mask, value, old[key]) for key, value in new.items()}
    if isinstance(new, tuple):
        parts = [merge_rows(mask, n, o) for n, o in zip(new, old, strict=True)]
        return type(new)(*parts) if hasattr(new, "_fields") else tuple(parts)
    return np.where(mask, new, old)


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
