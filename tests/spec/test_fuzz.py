"""Random and mutated texts: a task or a `SpecError` comes out, nothing else, and soon.

`pytest -m soak -s tests/spec/test_fuzz.py` runs 200,000 of them; HPRS_FUZZ_SEED chooses others.
"""

from __future__ import annotations

import math
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hprs.errors import SpecError
from hprs.semantics.evaluation import margins
from hprs.spec.json_format import task_from_json, task_to_json
from hprs.spec.parser import load_task, parse_task
from hprs.spec.printer import format_task
from hprs.spec.task import Task
from hprs.spec.vocabulary import FUNCTIONS
from tests.spec.malformed import MALFORMED

VALID = (
    """# Park the cart.
signal x     = obs[0] in [-4.8, 4.8]       "m"
signal v     = obs[1] in [-3, 3]           "m/s"
signal theta = obs[2] in [-0.42, 0.42]     "rad"
const mark = 1.0
let   off_mark = abs(x - mark)
ensure    on_track: abs(x) <= 2.4
ensure    pole_up:  abs(theta) <= 12 deg
conquer   parked:   off_mark <= 0.25
encourage upright:  abs(theta) <= 0.05
encourage slow:     abs(v) <= 0.5
prefer upright over slow
""",
    """signal beams[20] = obs.lidar[:] in [0, 10] "m"
signal u = action[0] initially 0 in [-1, 1]
signal w = info.progress in [0, inf]
let near = min(beams) in [0.1, 10]
let effort = hypot(u, 2 * u) ** 2 / (1 + u * u)
ensure clear: (near > 0.3 and u <= 0.9) or (
    near >= 0.5  # a comment
    and -0.5 <= u < 0.95
)
achieve far: clip(w, 0, 100) >= 90
encourage calm: effort <= 1e-1 or norm(beams) > 3
""",
    *(row.text for rows in MALFORMED.values() for row in rows),
)
_PLAIN = (
    "signal const let in initially prefer over and or not ensure achieve conquer encourage",
    "obs action last_action info x y v[3] theta pi deg inf env_reward a b eval",
    "0 1 2.5 -1 .5 1. 1e3 1e-3 1e308 1e999 9e-400 00 12 100000000000000000000",
    "+ - * / ** ( ) [ ] , : . = <= < >= > == != & | && || ^ =< := ; ! ~ % // ' { }",
)
WORDS = (
    *" ".join((*_PLAIN, *FUNCTIONS)).split(),
    *('"m"', '"', "#", "\n", "\n", "\n", "\r\n", "\t", "\0", "≤", "°", "θ", "\ufeff", "\ud800"),
    "signal x in [0, 1]\n",
    "signal v[3] = obs[0:3] in [-1, 1]\n",
    "ensure a: ",
    "let b = ",
)
ALPHABET = "abcdeghilnorstuvx_0123456789 +-*/()[],:.=<>#\"\n\t\r\0&|^!%;'é≤θ\u2028\ufeff"


def mutated(random_: random.Random, text: str) -> str:
    """One to eight edits of characters, words or lines."""
    for _ in range(random_.randint(1, 8)):
        start = random_.randint(0, len(text))
        stop = min(len(text), start + random_.choice((0, 1, 1, 2, 5, 30)))
        match random_.randrange(5):
            case 0:
                put = "".join(random_.choices(ALPHABET, k=random_.randint(0, 3)))
            case 1:
                put = f" {random_.choice(WORDS)} "
            case 2:
                put = text[start:stop] * random_.choice((2, 3, 50))
            case 3:
                other = random_.choice(VALID)
                cut = random_.randint(0, len(other))
                put = other[cut : cut + random_.randint(1, 40)]
            case _:
                put = chr(random_.choice((random_.randrange(128), random_.randrange(0x11000))))
        text = text[:start] + put + text[stop:]
    return text


def from_valid(random_: random.Random) -> str:
    return mutated(random_, random_.choice(VALID[:2] if random_.random() < 0.7 else VALID))


def from_words(random_: random.Random) -> str:
    joint = random_.choice((" ", " ", ""))
    head = random_.choice(("", "signal x in [0, 1]\nensure a: ", "signal x in [1, 2]\nlet b = "))
    return head + joint.join(random_.choices(WORDS, k=random_.randint(0, 25)))


def from_characters(random_: random.Random) -> str:
    return "".join(random_.choices(ALPHABET, k=random_.randint(0, 60)))


def from_expression(random_: random.Random) -> str:
    """A text with the shape of a task and an expression of any meaning."""

    def expression(depth: int) -> str:
        if depth == 0 or random_.random() < 0.2:
            return random_.choice(("x", "y", "v", "1", "0", "2.5", "1e200", "12 deg", "pi", "inf"))
        a, b = expression(depth - 1), expression(depth - 1)
        function = random_.choice(tuple(FUNCTIONS))
        operator = random_.choice(("+", "-", "*", "/", "**", "<=", "and", "or", ">"))
        return random_.choice(
            (f"{a} {operator} {b}", f"({a} {operator} {b})", f"-{a}", f"{function}({a}, {b})")
            + (f"{function}({a})",) * 2
        )

    ends = ("[0, 1]", "[-1, 1]", "[1, 2]", "[-inf, inf]", "[0, 1e308]")
    return (
        f"signal x in {random_.choice(ends)}\nsignal y in {random_.choice(ends)}\n"
        f"signal v[2] in {random_.choice(ends)}\nlet d = {expression(3)}\n"
        f"{random_.choice(('ensure', 'encourage', 'conquer'))} r: {expression(3)} <= "
        f"{expression(2)}\n"
    )


GENERATORS: dict[str, Callable[[random.Random], str]] = {
    "mutated tasks": from_valid,
    "sequences of words": from_words,
    "sequences of characters": from_characters,
    "random expressions": from_expression,
}


def attempt(text: str) -> str:
    """What comes out; a task also survives its own printer and JSON, and can be evaluated."""
    try:
        task = parse_task(text, path="fuzz.hprs")
    except SpecError as error:
        assert str(error)
        return type(error).__name__
    assert parse_task(format_task(task)) == task
    assert task_from_json(task_to_json(task)) == task
    evaluated(task)
    return "task"


def evaluated(task: Task) -> None:
    """Floats and arrays give the same finite numbers; without infinite ends, within the bounds."""
    shares = np.asarray([0.0, 0.3, 0.5, 1.0])
    ends = {s.name: task.ranges[s.name] for s in task.signals}
    bounded = all(math.isfinite(end.low) and math.isfinite(end.high) for end in ends.values())
    batch = {}
    for signal in task.signals:
        low, high = (max(-1e3, ends[signal.name].low), min(1e3, ends[signal.name].high))
        column = low + shares * (high - low)
        batch[signal.name] = (
            column
            if signal.length is None
            else np.repeat(column[:, None], min(signal.length, 100), axis=1)
        )
    with np.errstate(all="ignore"):
        found = margins(task, batch)
        for row in range(len(shares)):
            state = {name: value[row] for name, value in batch.items()}
            one = margins(task, {n: v if v.ndim else float(v) for n, v in state.items()})
            for label, (low, high) in task.bounds.items():
                margin = np.broadcast_to(found[label], shares.shape)[row]
                slack = 1e-9 * max(1.0, abs(margin))
                np.testing.assert_allclose(one[label], margin, rtol=1e-6, atol=slack)
                if bounded:
                    assert low - slack <= margin <= high + slack, (label, margin, low, high)


def fuzz(count: int, seed: int) -> Counter[str]:
    outcomes: Counter[str] = Counter()
    for index in range(count):
        random_ = random.Random(f"{seed}:{index}")  # so that one failure can be run again
        text = list(GENERATORS.values())[index % len(GENERATORS)](random_)
        start = time.process_time()
        try:
            outcomes[attempt(text)] += 1
        except Exception as error:
            raise AssertionError(f"seed {seed}, input {index}: {text!r}") from error
        assert time.process_time() - start < 5.0, (seed, index)
    return outcomes


def test_three_thousand_random_texts_give_tasks_or_spec_errors() -> None:
    outcomes = fuzz(3_000, seed=1)
    assert outcomes["task"] > 50
    assert outcomes["SpecSyntaxError"] > 50
    assert outcomes["SpecValidationError"] > 50


def test_random_bytes_in_files_give_tasks_or_spec_errors(tmp_path: Path) -> None:
    random_ = random.Random(2)
    path = tmp_path / "fuzz.hprs"
    for index in range(500):
        data = bytearray(random_.choice(VALID).encode("utf-8", "surrogatepass"))
        for _ in range(random_.randint(0, 5)):
            data.insert(random_.randint(0, len(data)), random_.randrange(256))
        path.write_bytes(random_.randbytes(random_.randint(0, 200)) if index % 5 == 0 else data)
        try:
            load_task(path)
        except SpecError as error:
            assert str(error)


@pytest.mark.soak
def test_two_hundred_thousand_random_texts_give_tasks_or_spec_errors() -> None:
    seed = int(os.environ.get("HPRS_FUZZ_SEED", "0"))
    start = time.perf_counter()
    outcomes = fuzz(200_000, seed)
    seconds = time.perf_counter() - start
    sys.stdout.write(f"\n200,000 texts, seed {seed}, {seconds:.0f} s: {dict(outcomes)}\n")
