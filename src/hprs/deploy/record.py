"""A drive as a CSV file, which `hprs assess` and `hprs watch` read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Dict, List, Mapping, Optional, Sequence, Union

from hprs.deploy.monitor import Verdict
from hprs.errors import BundleError

TIME = "time"
"""The column of time stamps, s."""
EXTRA = ("phase", "reason", "speed", "steering_angle", "decision", "lateness")
"""What a loop adds: in the columns `loop.phase` and so on, whose names no signal can have."""


class Record:
    """Writes one row a state; an empty cell is what is unknown.

    Args:
        path: The file; it must not exist.
        signals: Signals of the task, with the lengths of vectors.
        labels: Its requirements, whose margins are written too.

    Raises:
        BundleError: The file exists, or cannot be written.
    """

    def __init__(
        self,
        path: Union[str, Path],
        signals: Mapping[str, Optional[int]],
        labels: Sequence[str],
    ) -> None:
        self._columns: List[str] = []
        for name, length in signals.items():
            parts = [name] if length is None else ["%s[%d]" % (name, i) for i in range(length)]
            self._columns += parts
        header = [TIME] + self._columns + ["margin." + label for label in labels]
        header += ["loop." + name for name in EXTRA]
        try:
            # Kept open for the whole drive.
            self._file = Path(path).open("x", encoding="utf-8", newline="")
        except OSError as error:
            raise BundleError("{} cannot be written: {}.".format(path, error.strerror)) from None
        self._file.write(",".join(header) + "\n")

    def write(
        self,
        time: float,
        signals: Mapping[str, Any],
        verdicts: Sequence[Verdict],
        extra: Mapping[str, Any],
    ) -> None:
        """Add a state."""
        flat: Dict[str, Any] = {}
        for name, value in signals.items():
            if getattr(value, "ndim", 0) or isinstance(value, (list, tuple)):
                flat.update({"%s[%d]" % (name, i): one for i, one in enumerate(value)})
            else:
                flat[name] = value
        cells = ["%.6f" % time] + [_cell(flat.get(name)) for name in self._columns]
        cells += [_cell(verdict.margin) for verdict in verdicts]
        cells += [_cell(extra.get(name)) for name in EXTRA]
        self._file.write(",".join(cells) + "\n")

    def flush(self) -> None:
        """Give what is written to the system."""
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, str):
        return '"' + value.replace('"', "'") + '"'
    return "%.9g" % value
