"""Robustness is that of RTAMT, the monitor that the paper uses, on 1,000 random tasks and traces."""

from __future__ import annotations

import sys
import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest

from hprs import parse_task
from hprs.rewards import EpisodeRobustness
from hprs.semantics.robustness import robustness
from tests.rewards.episodes import rollout

pytestmark = pytest.mark.skipif(
    sys.version_info >= (3, 13), reason="RTAMT does not run on this Python"
)

NAMES = ("a", "b", "c")
SIGNALS = "".join(f"signal {name} in [-1, 1]\n" for name in NAMES)
TERMS = ("a", "b", "c", "a - b", "a + 0.5 * b", "a * c", "abs(b)", "abs(c - a)", "b / (c + 3)")


@cache
def monitor() -> Any:
    with warnings.catch_warnings():
        # It imports a parser that is older than this Python.
        warnings.simplefilter("ignore")
        import rtamt
    return rtamt


def judged(formula: str, trace: dict[str, np.ndarray]) -> float:
    """RTAMT's robustness of a formula at the beginning of a trace."""
    specification = monitor().StlDiscreteTimeSpecification()
    for name in NAMES:
        specification.declare_var(name, "float")
    specification.spec = formula
    specification.parse()
    times = list(range(len(trace["a"])))
    data = {"time": times} | {name: values.tolist() for name, values in trace.items()}
    return specification.evaluate(data)[0][1]


def predicate(rng: np.random.Generator, depth: int = 2) -> str:
    if depth and rng.random() < 0.4:
        connective = ("and", "or")[rng.integers(2)]
        parts = [predicate(rng, depth - 1) for _ in range(rng.integers(2, 4))]
        return "(" + f" {connective} ".join(f"({part})" for part in parts) + ")"
    relation = ("<=", "<", ">=", ">")[rng.integers(4)]
    term = TERMS[rng.integers(len(TERMS))]
    # Below the largest and above the smallest value of every term, so that none is decided.
    low = 0.05 if "abs" in term else -0.2
    return f"{term} {relation} {rng.uniform(low, 0.2):.3f}".replace(">= -", ">= 0 - ").replace(
        "> -", "> 0 - "
    )


OPERATORS = {
    "ensure": "always({})",
    "achieve": "eventually({})",
    "conquer": "eventually(always({}))",
}


@pytest.mark.parametrize("block", range(10))
def test_a_whole_task_is_worth_the_same(block: int) -> None:
    for number in range(100):
        rng = np.random.default_rng([block, number])
        kinds = ["ensure"] * int(rng.integers(0, 3)) + [("achieve", "conquer")[number % 2]]
        parts = [(kind, predicate(rng)) for kind in kinds]
        trace = {name: rng.uniform(-1, 1, int(rng.integers(2, 12))) for name in NAMES}
        length = min(map(len, trace.values()))
        trace = {name: values[:length] for name, values in trace.items()}
        task = parse_task(
            SIGNALS + "\n".join(f"{kind} r{i}: {text}" for i, (kind, text) in enumerate(parts))
        )
        formula = " and ".join(f"({OPERATORS[kind].format(text)})" for kind, text in parts)
        wanted = judged(formula, trace)
        found = robustness(task, trace)
        assert min(found.values()) == pytest.approx(wanted, abs=1e-9), formula
        paid = rollout(EpisodeRobustness(task, "raw"), trace, terminated=False, truncated=True)
        assert paid[-1] == pytest.approx(wanted, abs=1e-9), formula


@pytest.mark.parametrize("kind", OPERATORS)
def test_one_requirement_is_worth_the_same(kind: str) -> None:
    for number in range(30):
        rng = np.random.default_rng([number, 7])
        text = predicate(rng)
        trace = {name: rng.uniform(-1, 1, 9) for name in NAMES}
        found = robustness(parse_task(f"{SIGNALS}{kind} r: {text}"), trace)["r"]
        assert found == pytest.approx(judged(OPERATORS[kind].format(text), trace), abs=1e-9)
