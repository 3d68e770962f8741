"""SAC on environments that Python steps: acting and updating are compiled, stepping is not."""

from __future__ import annotations

from hprs.training.configuration import Configuration
from hprs.training.session import Session
from hprs.wrappers.single import TaskWrapper


def open_host(configuration: Configuration, environment: TaskWrapper) -> Session:
    """A session that steps environments of its own."""
    raise NotImplementedError
