"""Reads a recorded trace from a Parquet file, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hprs.cli.console import plural
from hprs.cli.trace_columns import CHUNK, Clock, Wanted, too_short
from hprs.errors import MissingExtraError, TraceError


def parquet_chunks(path: Path, wanted: Wanted) -> Iterator[dict[str, Any]]:
    """The signals of a Parquet file: one row a state.

    A vector is one column of lists, or has the columns `name[0]`, `name[1]` and so on.

    Raises:
        TraceError: As for CSV files.
        MissingExtraError: PyArrow is not installed.
    """
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError("pyarrow", "parquet") from None
    try:
        # A row group may be as large as the file: it is read as it is needed.
        with parquet.ParquetFile(path, buffer_size=1 << 18, pre_buffer=False) as file:
            yield from _chunks(path, file, wanted)
    except (arrow.ArrowInvalid, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise TraceError(f"{path} cannot be read as a Parquet file: {reason}.") from None


def _chunks(path: Path, file: Any, wanted: Wanted) -> Iterator[dict[str, Any]]:
    header = list(file.schema_arrow.names)
    columns = wanted.find(path, header, lists=True)
    time = wanted.find_time(path, header)
    lengths = {signal.name: signal.length for signal in wanted.signals}
    clock = None if time is None else Clock(time)
    names = {name for found in columns.values() for name in np.atleast_1d(found).tolist()}
    gaps, count = wanted.missing == "unknown", 0
    for batch in file.iter_batches(CHUNK, columns=[*names, *([time] if time else [])]):
        first = count

        def place(row: int, first: int = first) -> str:
            return f"{path}, row {first + row + 1:,}"

        def column(name: str, length: int | None = None, batch: Any = batch) -> Any:
            return _column(batch.column(name), name, length, gaps=gaps, place=place)

        if clock is not None and time is not None:
            stamps = batch.column(time)
            clock.check(_stamps(stamps, time, path, place), place, _reader(stamps))
        chunk: dict[str, Any] = {}
        for name, found in columns.items():
            if isinstance(found, str):
                chunk[name] = column(found, lengths[name])
            else:
                chunk[name] = np.stack([column(one) for one in found], axis=-1)
        yield chunk
        count += batch.num_rows
    if count < 2:
        raise too_short(path, plural(count, "row"))


def _reader(stamps: Any) -> Callable[[int], str]:
    def shown(row: int) -> str:
        try:
            return str(stamps[row].as_py())
        except ValueError:
            # Python's dates have microseconds.
            return stamps[row].cast("string").as_py()

    return shown


def _stamps(stamps: Any, name: str, path: Path, place: Callable[[int], str]) -> Any:
    """Time stamps as numbers; dates as their number of ticks."""
    from pyarrow import types

    if stamps.null_count:
        raise _empty(place, name, int(np.argmin(_is_valid(stamps))))
    if types.is_temporal(stamps.type):
        stamps = stamps.cast("int64", safe=False) if stamps.type.bit_width == 64 else stamps
    if not (types.is_integer(stamps.type) or types.is_floating(stamps.type)):
        raise TraceError(f"{path}: time stamps are numbers or dates; '{name}' is {stamps.type}.")
    return stamps.to_numpy(zero_copy_only=False)


def _column(
    values: Any, name: str, length: int | None, *, gaps: bool, place: Callable[[int], str]
) -> Any:
    """A column's numbers: one a row, or a vector a row."""
    import pyarrow as arrow
    from pyarrow import types

    kind = values.type
    if types.is_null(kind):
        # Nothing says of what type a column is in which every cell is empty.
        values = values.cast("float64" if length is None else arrow.list_(arrow.float64()))
        kind = values.type
    listed = types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)
    if listed and length is not None:
        return _vectors(values, name, length, gaps=gaps, place=place)
    numbers = types.is_integer(kind) or types.is_floating(kind) or types.is_boolean(kind)
    if not (numbers or types.is_decimal(kind)):
        raise TraceError(f"{place(0)}: column '{name}' is of type {kind}, not a number.")
    found = np.asarray(values.cast("float64", safe=False).to_numpy(zero_copy_only=False))
    if not gaps:
        wrong = np.flatnonzero(np.isnan(found))
        if wrong.size:
            row = int(wrong[0])
            if not values[row].is_valid:
                raise _empty(place, name, row)
            raise TraceError(f"{place(row)}: column '{name}' is NaN.")
    return found


def _vectors(
    values: Any, name: str, length: int, *, gaps: bool, place: Callable[[int], str]
) -> Any:
    import pyarrow.compute as compute

    # PyArrow makes its functions when it is loaded, so that checkers do not see them.
    sizes: Any = compute.list_value_length(values).to_numpy(zero_copy_only=False)  # pyright: ignore[reportAttributeAccessIssue]
    valid = _is_valid(values)
    wrong = np.flatnonzero(((sizes != length) & valid) | (False if gaps else ~valid))
    if wrong.size:
        row = int(wrong[0])
        if not valid[row]:
            raise _empty(place, name, row)
        found = plural(len(values[row].as_py()), "component")
        raise TraceError(f"{place(row)}: column '{name}' has {found}, the signal {length}.")

    def place_of(row: int) -> str:
        return place(row // length)

    # Flattening leaves out the rows that are empty.
    flat = _column(values.flatten(), name, None, gaps=gaps, place=place_of)
    filled = np.full((len(valid), length), np.nan)
    filled[valid] = flat.reshape(-1, length)
    return filled


def _is_valid(values: Any) -> Any:
    return values.is_valid().to_numpy(zero_copy_only=False)


def _empty(place: Callable[[int], str], name: str, row: int) -> TraceError:
    return TraceError(f"{place(row)}: column '{name}' is empty.")
