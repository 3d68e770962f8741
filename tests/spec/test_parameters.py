"""Other values for a task's constants, as a command line gives them."""

from __future__ import annotations

import pytest

from hprs import parse_task
from hprs.errors import SpecError, UsageError
from hprs.spec.expression import Name, Negate, Number
from hprs.spec.parameters import override, parse_constants

PARKING = """signal x in [-3, 3]
const mark = 1
conquer parked: abs(x - mark) <= 0.25
"""


def test_pairs_are_read_as_the_language_writes_values() -> None:
    assert parse_constants(["mark=-1", " tilt = 12 deg", "a=2 # m"]) == {
        "mark": Negate(Number(1.0)),
        "tilt": Number(12.0) * Name("deg"),
        "a": Number(2.0),
    }
    assert parse_constants(()) == {}


@pytest.mark.parametrize(
    ("pair", "message"),
    [
        ("mark", "given as NAME=VALUE, as in mark=-1; got 'mark'"),
        ("mark=", "given as NAME=VALUE"),
        ("=1", "given as NAME=VALUE"),
        ("mark==1", "the constant 'mark==1' cannot be meant: "),
        ("mark=x", "cannot be meant: unknown name 'x'"),
        ("mark=inf", "inf may stand only at the end of a range"),
        ("mark=nan", "unknown name 'nan'"),
        ("mark=1e999", "too large"),
        ("mark=1\nensure a: 1 > 0", "given more than a value"),
        ("mark=1\nconst b = 2", "given more than a value"),
        ("and=1", "cannot be meant"),
    ],
)
def test_malformed_pairs_are_refused(pair: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        parse_constants([pair])


def test_a_constant_is_given_once() -> None:
    with pytest.raises(UsageError, match="'mark' is given twice"):
        parse_constants(["mark=1", "mark=2"])


def test_errors_name_the_file_and_the_line() -> None:
    task = parse_task(PARKING)
    other = override(task, parse_constants(["mark=-1"]), path="parking.hprs")
    assert other == task.with_constants(mark=-1)
    with pytest.raises(SpecError, match=r"parking.hprs: the task has no constant 'marc'"):
        override(task, {"marc": 1.0}, path="parking.hprs")
    with pytest.raises(SpecError, match=r"parking.hprs:3:9: requirement 'parked' can never"):
        override(task, {"mark": 9.0}, path="parking.hprs")


def test_errors_show_the_line_and_the_values() -> None:
    with pytest.raises(SpecError) as caught:
        override(parse_task(PARKING), parse_constants(["mark=2 * 50"]), path="p.hprs", text=PARKING)
    head, line, caret = str(caught.value).splitlines()
    assert head.startswith("p.hprs:3:9: requirement 'parked' can never be satisfied")
    assert head.endswith(" Here, mark = 2 * 50.")
    assert line == "    3 | conquer parked: abs(x - mark) <= 0.25"
    assert caret == "      |         ^^^^^^"
