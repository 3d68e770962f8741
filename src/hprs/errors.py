"""The exceptions that hprs raises.

```
HprsError
├── SpecError (ValueError)          a task is wrong; carries file, line, column and a caret
│   ├── SpecSyntaxError             the text does not follow the grammar
│   └── SpecValidationError         the text is well formed and its meaning is not
│       └── SpecTypeError (TypeError)   a Python object of the wrong kind stands in a task
├── SignalError (ValueError)        a signal is missing, misshapen or NaN at run time
├── TraceError (ValueError)         a recorded trace cannot be assessed
├── PolicyError (ValueError)        a policy fails, or does not fit the environment
├── TrackError (ValueError)         a track or a map file cannot be driven or read
├── BundleError (ValueError)        a policy bundle is damaged, or does not fit
├── GridError (ValueError)          a grid of trainings is wrong
├── RunError (RuntimeError)         a run directory cannot be read, written or resumed
└── UsageError (ValueError)         an unknown name or option; the message lists what exists
    └── MissingExtraError           an optional dependency is not installed
```
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Position(NamedTuple):
    """A stretch of one line of a task's text; lines and columns count from 1."""

    line: int
    column: int
    width: int = 1


class HprsError(Exception):
    """Base class of every error that hprs raises on purpose."""


class SpecError(HprsError, ValueError):
    """A task is wrong.

    Args:
        message: What was found and what to do.
        position: Where in the text; None for a task that was built in Python.
        text: The whole text of the task, for the line and the caret.
        path: The file's name.
    """

    def __init__(
        self,
        message: str,
        position: Position | None = None,
        *,
        text: str | None = None,
        path: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.position = position
        self.text = text
        self.path = path

    def __str__(self) -> str:
        """Message with file, line, column and a caret below the place, as far as they are known."""
        if self.position is None:
            return f"{self.path}: {self.message}" if self.path else self.message
        line, column = self.position.line, self.position.column
        head = f"{self.path or 'task'}:{line}:{column}: {self.message}"
        if self.text is None:
            return head
        lines = self.text.split("\n")
        shown = _printable(lines[line - 1]) if line <= len(lines) else ""
        first = max(0, column - 1 - 60)
        shown = shown[first : first + 100]
        carets = "^" * max(1, min(self.position.width, len(shown) - (column - 1 - first)))
        gutter = f"{line:>5} | "
        return f"{head}\n{gutter}{shown}\n{'|':>7} {' ' * (column - 1 - first)}{carets}"


class SpecSyntaxError(SpecError):
    """The text does not follow the grammar."""


class SpecValidationError(SpecError):
    """The task is well formed, but what it says cannot be meant."""


class SpecTypeError(SpecValidationError, TypeError):
    """A Python object of the wrong kind stands where a part of a task is expected."""


class SignalError(HprsError, ValueError):
    """A signal is missing, has the wrong shape or is NaN."""


class TraceError(HprsError, ValueError):
    """A recorded trace cannot be assessed."""


class PolicyError(HprsError, ValueError):
    """A policy fails, or does not fit the environment."""


class TrackError(HprsError, ValueError):
    """A track or a map file cannot be read, or no car could drive it."""


class BundleError(HprsError, ValueError):
    """A policy bundle is damaged, or does not fit."""


class GridError(HprsError, ValueError):
    """A grid of trainings is wrong."""


class RunError(HprsError, RuntimeError):
    """A run directory cannot be read, written or resumed."""


class UsageError(HprsError, ValueError):
    """A name or an option is unknown."""


class MissingExtraError(UsageError, ImportError):
    """An optional dependency is not installed."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(
            f"{package} is not installed. Install it with: pip install 'hprs[{extra}]'"
        )


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A sentence that suggests the closest known name, or an empty string."""
    # Only mistakes need it, and it costs a millisecond to import.
    import difflib

    # Its cost grows with number times squared length, and a text may be hostile.
    comparable = [candidate for candidate in known if len(candidate) <= 40][:1000]
    close = difflib.get_close_matches(name[:40], comparable, n=1, cutoff=0.6)
    return f" Did you mean '{close[0]}'?" if close else ""


def _printable(line: str) -> str:
    return "".join(character if character.isprintable() else " " for character in line)
