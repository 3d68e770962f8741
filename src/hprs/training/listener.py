"""What a training tells whoever watches it."""

from __future__ import annotations

from typing import Protocol

from hprs.semantics.assessment import Summary
from hprs.training.configuration import Configuration


class Listener(Protocol):
    """Hears of a training's progress."""

    def started(self, configuration: Configuration, step: int) -> None:
        """A training starts, or goes on from a step."""
        ...

    def advanced(self, step: int) -> None:
        """The training has made this many steps."""
        ...

    def evaluated(self, step: int, summary: Summary) -> None:
        """The policy of a step was evaluated."""
        ...

    def noticed(self, text: str) -> None:
        """Something that whoever watches should know, in one line."""
        ...

    def stopping(self) -> None:
        """The training was asked to stop and will, as soon as its state can be saved."""
        ...

    def ended(self) -> None:
        """The training is over, finished or stopped."""
        ...


class Silence:
    """A listener that does nothing."""

    def started(self, configuration: Configuration, step: int) -> None:
        """Nothing."""

    def advanced(self, step: int) -> None:
        """Nothing."""

    def evaluated(self, step: int, summary: Summary) -> None:
        """Nothing."""

    def noticed(self, text: str) -> None:
        """Nothing."""

    def stopping(self) -> None:
        """Nothing."""

    def ended(self) -> None:
        """Nothing."""
