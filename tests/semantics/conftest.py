"""The paper's driving example."""

from __future__ import annotations

import pytest

from hprs import parse_task
from hprs.spec.task import Task

DRIVING = """
signal lap          in [0, 1.5]
signal walls        in [-0.25, 2]  "m"
signal centre       in [0, 1]      "m"
signal v            in [0, 5]      "m/s"
signal alpha        in [-1, 1]     "rad"
signal turned[2]    in [-2, 2]

achieve   finish:    lap >= 1
ensure    off_walls: walls > 0
encourage central:   centre <= 0.5
encourage fast:      v >= 2
encourage slow:      v <= 3.5
encourage straight:  abs(alpha) <= 0.1
encourage smooth:    norm(turned) <= 0.25
"""


@pytest.fixture(scope="session")
def driving() -> Task:
    return parse_task(DRIVING)
