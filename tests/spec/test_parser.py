from __future__ import annotations

import ast
import pickle
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from hprs.errors import Position, SpecError, SpecSyntaxError, SpecValidationError
from hprs.spec.expression import And, Binary, Call, Comparison, Expression, Name, Negate, Number, Or
from hprs.spec.parser import MAX_BRACKETS, MAX_WORDS, load_task, parse_task
from hprs.spec.task import Constant, Definition, Preference, Requirement, Signal, Source, Task
from hprs.spec.task_file import MAX_BYTES
from tests.spec.malformed import MALFORMED, Malformed, render

ROOT = Path(__file__).parents[2]
X, Y, Z = Name("x"), Name("y"), Name("z")
ONE, TWO = Number(1.0), Number(2.0)
SIGNALS = "signal x in [0.5, 2]\nsignal y in [0.5, 2]\nsignal z in [0.5, 2]\n"


def expression_of(text: str) -> Expression:
    return parse_task(f"{SIGNALS}let e = {text}").definitions[0].value


def predicate_of(text: str) -> Comparison | And | Or:
    return parse_task(f"{SIGNALS}ensure r: {text}").requirements[0].predicate


def within_a_second(work: Callable[[], object]) -> None:
    """See that work takes less than a second of processor time; ten under coverage.

    One of three tries must: beside other work a processor can be three times as slow.
    """
    allowed = 1.0 if sys.gettrace() is None else 10.0
    for _ in range(3):
        start = time.process_time()
        work()
        if time.process_time() - start < allowed:
            return
    pytest.fail(f"it took more than {allowed} s three times")


def refusal(read: Callable[[], object], match: str | None = None) -> str:
    with pytest.raises(SpecError, match=match) as caught:
        read()
    return str(caught.value)


# --- malformed tasks


@pytest.mark.parametrize(
    "row", [row for rows in MALFORMED.values() for row in rows], ids=lambda row: row.title
)
def test_each_malformed_task_gets_its_exact_message(row: Malformed) -> None:
    with pytest.raises(SpecError) as caught:
        parse_task(row.text, path="task.hprs")
    assert str(caught.value) == row.message


def test_the_page_of_error_messages_is_the_rendered_table() -> None:
    page = (ROOT / "docs" / "errors.md").read_text("utf-8")
    assert page == render(), "run: python tests/spec/malformed.py > docs/errors.md"


def test_the_table_has_at_least_45_rows_and_no_row_twice() -> None:
    rows = [row for rows in MALFORMED.values() for row in rows]
    assert len(rows) >= 45
    assert len({row.text for row in rows}) == len({row.title for row in rows}) == len(rows)


def test_messages_hold_no_vocabulary_of_the_parser_generator() -> None:
    messages = " ".join(row.message for rows in MALFORMED.values() for row in rows)
    terminals = (
        r"\b(LSQB|RSQB|LPAR|RPAR|NEWLINE|_NEWLINE|COLON|EQUAL|UNKNOWN|MISTAKE|Token|Unexpected)\b"
    )
    assert re.search(terminals, messages) is None


# --- hostile input

HOSTILE = {
    "20,000 parentheses": "ensure a: " + "(" * 20_000,
    "20,000 closed parentheses": "ensure a: " + "(" * 20_000 + "1" + ")" * 20_000 + " <= 2",
    "20,000 minus signs": "ensure a: " + "-" * 20_000 + "1 <= 2",
    "19,000 minus signs": "ensure a: " + "-" * 19_000 + "1 <= 2",
    "20,000 calls": "ensure a: " + "abs(" * 20_000 + "1" + ")" * 20_000 + " <= 2",
    "150 calls": "ensure a: " + "abs(" * 150 + "1" + ")" * 150 + " <= 2",
    "20,000 powers": "ensure a: " + " ** ".join(["2"] * 20_000) + " <= 2",
    "9,000 powers": "ensure a: " + " ** ".join(["2"] * 9_000) + " <= 2",
    "a sum of 20,000": "ensure a: " + " + ".join(["1"] * 20_000) + " <= 2",
    "a conjunction of 20,000": "ensure a: " + " and ".join(["1 <= 2"] * 20_000),
    "a chain of 20,000": "ensure a: " + " <= ".join(["1"] * 20_000),
    "alternating and / or": "ensure a: " + "(1 <= 2 and (1 <= 2 or " * 95 + "1 <= 2" + "))" * 95,
    "a million digits": "ensure a: x <= " + "1" * 999_000,
    "a million digits after the point": "ensure a: x <= 0." + "1" * 999_000,
    "an exponent of 400 digits": "ensure a: 1e" + "9" * 390 + " <= 2",
    "a negative exponent of 400 digits": "ensure a: 1e-" + "9" * 390 + " <= 2",
    "a huge number": "ensure a: 1e999 <= 2",
    "a huge power": "ensure a: 10 ** 10 ** 10 ** 10 <= 2",
    "a hidden huge power": "signal x in [0, 1]\nensure a: x <= 1.0001 ** 1e300",
    "a huge index": f"signal x = obs[{'9' * 5000}] in [0, 1]",
    "a huge length": f"signal x[{'9' * 300}] in [0, 1]",
    "a long name": f"signal {'a' * 900_000} in [0, 1]",
    "many similar names": "\n".join(f"const {'a' * 90}{i} = 1" for i in range(3_900))
    + "\nensure a: aa <= 2",
    "many similar short names": "\n".join(f"const {'a' * 30}{i} = 1" for i in range(3_900))
    + f"\nensure a: {'a' * 34} <= 2",
    "too many requirements": "signal x in [0, 1]\n"
    + "".join(f"ensure r{i}: x <= 1\n" for i in range(2_500)),
    "too many preferences": "ensure a: 0 <= 1\nensure b: 0 <= 1\n" + "prefer a over b\n" * 4_000,
    "a million newlines and a word": "\n" * 999_000 + "x",
    "a million spaces and a word": " " * 999_000 + "x",
    "a million quotes": '"' * 999_000,
    "a million dots": "." * 999_000,
    "a million NUL characters": "\0" * 999_000,
    "a NUL in a comment": "# \0",
    "a lone surrogate": "signal \ud800 in [0, 1]",
    "a lone surrogate in a unit": 'signal x in [0, 1] "\ud800"',
    "a byte order mark in the middle": "signal x in [0, 1]\n\ufeffsignal y in [0, 1]",
    "a vertical tab": "signal x\vin [0, 1]",
    "too many bytes": "#" * (MAX_BYTES + 1),
    "too many bytes in fewer characters": "#" + "λ" * (MAX_BYTES // 2),
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE.keys())
def test_hostile_text_is_refused_within_a_second(text: str) -> None:
    parse_task("")
    messages: list[str] = []
    within_a_second(lambda: messages.append(refusal(lambda: parse_task(text))))
    assert len(messages[-1].encode()) < 2_000


EXPENSIVE = {
    "500 requirements in a chain of preferences": "signal x in [0, 1]\n"
    + "".join(f"ensure r{i}: x <= 0.5\n" for i in range(500))
    + "".join(f"prefer r{i} over r{i + 1}\n" for i in reversed(range(499))),
    "2,000 reductions of a vector of a million": "signal v[1000000] in [0, 1]\nensure a: "
    + " and ".join(["sum(v) <= 3"] * 2_000),
    "a conjunction of 4,900": "signal x in [0, 1]\nensure a: " + " and ".join(["x <= 0.5"] * 4_900),
    "3,900 definitions, each of the one before": "signal x in [0, 1]\nlet a0 = x\n"
    + "".join(f"let a{i} = a{i - 1}\n" for i in range(1, 3_900)),
    "a million newlines": "\n" * 999_000,
}


@pytest.mark.parametrize("text", EXPENSIVE.values(), ids=EXPENSIVE.keys())
def test_the_largest_legal_tasks_are_built_within_a_second(text: str) -> None:
    parse_task("")
    within_a_second(lambda: parse_task(text))


def test_brackets_may_nest_as_deep_as_the_limit_says() -> None:
    parse_task(f"ensure a: {'(' * MAX_BRACKETS}1{')' * MAX_BRACKETS} <= 2")
    with pytest.raises(SpecSyntaxError, match="nested deeper"):
        parse_task(f"ensure a: ({'(' * MAX_BRACKETS}1{')' * MAX_BRACKETS}) <= 2")


def test_comments_and_blank_lines_do_not_count_as_words() -> None:
    assert parse_task("# comment\n\n" * (MAX_WORDS + 1)) == Task()


# --- files


def write(folder: Path, data: bytes) -> Path:
    path = folder / "task.hprs"
    path.write_bytes(data)
    return path


def test_a_file_gives_the_same_task_as_its_text(tmp_path: Path) -> None:
    text = 'signal x in [0, 1] "µm"\nensure a: x <= 0.5\n'
    assert load_task(write(tmp_path, text.encode())) == parse_task(text)
    assert load_task(str(write(tmp_path, text.encode()))) == parse_task(text)


def test_a_byte_order_mark_of_utf8_is_accepted(tmp_path: Path) -> None:
    assert load_task(write(tmp_path, b"\xef\xbb\xbfconst a = 1")).constants[0].name == "a"
    assert parse_task("\ufeffconst a = 1").constants[0].name == "a"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"], ids=["unix", "windows", "old mac"])
def test_every_kind_of_line_end_is_accepted_and_counted(tmp_path: Path, end: str) -> None:
    lines = ("signal x in [0, 1]  # a comment", "", "ensure a: (x", "  <= 1)")
    assert load_task(write(tmp_path, end.join(lines).encode())).labels == ("a",)
    with pytest.raises(SpecError, match=r"task\.hprs:5:11: unknown name 'y'") as caught:
        load_task(write(tmp_path, end.join((*lines, "ensure b: y <= 1", "")).encode()))
    assert str(caught.value).endswith("    5 | ensure b: y <= 1\n      |           ^")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("const a = 1".encode("utf-16"), "encoded as UTF-16. Save it as UTF-8"),
        ("const a = 1".encode("utf-16-le"), "NUL character"),
        (b"const a = 1\n# caf\xe9\n", "line 2 holds the byte 0xE9, which is not UTF-8"),
        (b"\xff" * 100, "line 1 holds the byte 0xFF|UTF-16"),
        (b"const a\0 = 1", "NUL character"),
        (b"#" * (MAX_BYTES + 1), "may have 1000000 bytes"),
        (bytes(range(256)), "NUL character|not UTF-8"),
    ],
)
def test_files_that_are_not_text_are_refused_by_name(
    tmp_path: Path, data: bytes, message: str
) -> None:
    path = write(tmp_path, data)
    messages: list[str] = []
    within_a_second(lambda: messages.append(refusal(lambda: load_task(path), message)))
    assert str(path) in messages[-1]


def test_a_missing_file_a_folder_and_an_impossible_name_are_spec_errors(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"no\.hprs: this task cannot be read: No such file"):
        load_task(tmp_path / "no.hprs")
    with pytest.raises(SpecError, match="cannot be read: Is a directory"):
        load_task(tmp_path)
    with pytest.raises(SpecError, match=r"cannot be read: .*null"):
        load_task("a\0b")


def test_errors_carry_path_text_and_position() -> None:
    with pytest.raises(SpecValidationError) as caught:
        parse_task("ensure a: x <= 1", path="dir/my.hprs")
    error = caught.value
    assert (error.path, error.text) == ("dir/my.hprs", "ensure a: x <= 1")
    assert error.position == Position(1, 11, 1)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_the_caret_of_a_long_line_stays_in_view() -> None:
    with pytest.raises(SpecError) as caught:
        parse_task(f"ensure a: {'1 + ' * 60}x <= 1")
    _, shown, carets = str(caught.value).split("\n")
    assert shown[carets.index("^")] == "x"
    assert len(shown) <= 110


# --- statements


def test_every_kind_of_statement_is_read() -> None:
    task = parse_task(
        """
        # A comment, and a blank line above.
        signal pose[3] = obs.pose[0:3] initially -top in [-top, top] "m"
        signal speed in [0, inf]
        const top = 2.5
        let far = max(pose) in [0, 2]  # tightened
        ensure slow: speed <= 1
        achieve there: far >= 1
        encourage calm: far <= 1
        prefer there over calm
        """
    )
    top = Name("top")
    pose = Signal(
        "pose",
        Negate(top),
        top,
        source=Source("obs", ("pose",), (0, 3)),
        length=3,
        initially=Negate(top),
        unit="m",
    )
    far = Name("far")
    assert task == Task(
        signals=(pose, Signal("speed", 0.0, Name("inf"))),
        requirements=(
            Requirement("ensure", "slow", Name("speed") <= 1),
            Requirement("achieve", "there", far >= 1),
            Requirement("encourage", "calm", far <= 1),
        ),
        constants=(Constant("top", Number(2.5)),),
        definitions=(Definition("far", Call("max", (Name("pose"),)), Number(0.0), TWO),),
        preferences=(Preference("there", "calm"),),
    )


@pytest.mark.parametrize(
    ("text", "source"),
    [
        ("obs", Source("obs")),
        ("obs[0]", Source("obs", (), 0)),
        ("obs[-1]", Source("obs", (), -1)),
        ("obs.pose.x", Source("obs", ("pose", "x"))),
        ("obs.signal.in[2]", Source("obs", ("signal", "in"), 2)),
        ("action[1]", Source("action", (), 1)),
        ("last_action", Source("last_action")),
        ("info.progress", Source("info", ("progress",))),
    ],
)
def test_sources_of_scalars_are_read(text: str, source: Source) -> None:
    assert parse_task(f"signal x = {text} in [0, 1]").signals[0].source == source


@pytest.mark.parametrize(
    ("text", "index"),
    [
        ("0:3", (0, 3)),
        (":3", (None, 3)),
        ("-3:", (-3, None)),
        (":", (None, None)),
        ("0:-1", (0, -1)),
    ],
)
def test_slices_of_vectors_are_read(text: str, index: tuple[int | None, int | None]) -> None:
    assert parse_task(f"signal x[3] = obs[{text}] in [0, 1]").signals[0].source == Source(
        "obs", (), index
    )


def test_newlines_are_free_inside_brackets_of_either_kind() -> None:
    text = "signal x in [\n0,  # low\n\n1]\nensure a: (x\n+ 1\n) <= 2\nlet b = min(\nx,\n2,\n)"
    task = parse_task(text)
    assert task.labels == ("a",)
    assert task.definitions[0].value == Call("min", (X, TWO))


@pytest.mark.parametrize("text", ["", "\n", "# only a comment", " \t \n#\n", "\ufeff"])
def test_a_text_without_statements_is_the_empty_task(text: str) -> None:
    assert parse_task(text) == Task()


@pytest.mark.parametrize("unit", ["m", "", "# no comment", "°", "\\", "a'b"])
def test_units_are_taken_literally(unit: str) -> None:
    assert parse_task(f'signal x in [0, 1] "{unit}"').signals[0].unit == unit


def test_the_order_of_statements_of_different_kinds_is_free() -> None:
    lines = ["ensure a: y <= m", "let y = 2 * x", "signal x in [0, m]", "const m = 3"]
    assert parse_task("\n".join(lines)) == parse_task("\n".join(reversed(lines)))


# --- expressions


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x - y - z", Binary("-", Binary("-", X, Y), Z)),
        ("x - (y - z)", Binary("-", X, Binary("-", Y, Z))),
        ("x + y * z", Binary("+", X, Binary("*", Y, Z))),
        ("x / y * z", Binary("*", Binary("/", X, Y), Z)),
        ("-x ** 2", Negate(Binary("**", X, TWO))),
        ("(-x) ** 2", Binary("**", Negate(X), TWO)),
        ("2 ** -1", Binary("**", TWO, Negate(ONE))),
        ("x ** y ** z", Binary("**", X, Binary("**", Y, Z))),
        ("x ** -y ** z", Binary("**", X, Negate(Binary("**", Y, Z)))),
        ("-x * y", Binary("*", Negate(X), Y)),
        ("x * -y", Binary("*", X, Negate(Y))),
        ("x - -y", Binary("-", X, Negate(Y))),
        ("--x", Negate(Negate(X))),
        ("((x))", X),
        ("12 deg", Binary("*", Number(12.0), Name("deg"))),
        ("12 * deg", Binary("*", Number(12.0), Name("deg"))),
        ("12deg", Binary("*", Number(12.0), Name("deg"))),
        ("-12 deg", Negate(Binary("*", Number(12.0), Name("deg")))),
        ("x * deg", Binary("*", X, Name("deg"))),
        ("deg", Name("deg")),
        ("pi", Name("pi")),
        ("clip(x, -1, y + 1)", Call("clip", (X, Negate(ONE), Binary("+", Y, ONE)))),
        ("min(x, y, )", Call("min", (X, Y))),
        ("1e3", Number(1000.0)),
        (".5", Number(0.5)),
        ("5.", Number(5.0)),
        ("1.5E-2", Number(0.015)),
        ("007", Number(7.0)),
        ("0e999", Number(0.0)),
    ],
)
def test_expressions_follow_the_precedence_of_python(text: str, expected: Expression) -> None:
    assert expression_of(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(x <= 1) and y > 1", And((X <= 1, Y > 1))),
        ("(x + 1) <= y", Binary("+", X, ONE) <= Y),
        ("((x + 1) <= y)", Binary("+", X, ONE) <= Y),
        ("x <= 1 or y <= 1 and z <= 1", Or((X <= 1, And((Y <= 1, Z <= 1))))),
        ("(x <= 1 or y <= 1) and z <= 1", And((Or((X <= 1, Y <= 1)), Z <= 1))),
        ("(x <= 1 and y <= 1) and z <= 1", And((X <= 1, Y <= 1, Z <= 1))),
        ("1 <= x <= 2", And((Comparison(ONE, "<=", X), X <= 2))),
        ("2 > x >= y", And((Comparison(TWO, ">", X), X >= Y))),
        ("1 < x <= y < 2", And((Comparison(ONE, "<", X), X <= Y, Y < 2))),
        ("1 <= x <= 2 and y <= 1", And((Comparison(ONE, "<=", X), X <= 2, Y <= 1))),
        ("x<=1and y<=1", And((X <= 1, Y <= 1))),
    ],
)
def test_predicates_are_told_apart_from_numbers(text: str, expected: Comparison | And | Or) -> None:
    assert predicate_of(text) == expected


def test_every_node_knows_its_place() -> None:
    task = parse_task("signal x in [0, 9]\nensure a: abs(x - 2 deg) <= 3 and (\n x > 1)")
    predicate = task.requirements[0].predicate
    assert isinstance(predicate, And)
    first, second = predicate.parts
    assert isinstance(first, Comparison)
    assert isinstance(second, Comparison)
    call = first.left
    assert isinstance(call, Call)
    difference = call.arguments[0]
    assert isinstance(difference, Binary)
    assert task.signals[0].position == Position(1, 8, 1)
    assert task.signals[0].high.position == Position(1, 17, 1)
    assert task.requirements[0].position == Position(2, 8, 1)
    assert predicate.position == Position(2, 11, 19)  # goes on in the next line
    assert first.position == Position(2, 11, 19)
    assert call.position == Position(2, 11, 14)
    assert difference.position == Position(2, 15, 9)
    assert difference.right.position == Position(2, 19, 5)
    assert second.position == Position(3, 2, 5)


def test_names_of_functions_and_roots_are_free_where_nothing_is_ambiguous() -> None:
    task = parse_task("signal obs = obs[0] in [0, 1]\nensure info: obs <= 0.5")
    assert task.requirements[0].predicate == (Name("obs") <= 0.5)


# --- nothing of the text is executed


def calls_of(path: Path, functions: set[str]) -> list[tuple[str, str]]:
    """File and text of every call of one of these functions by its plain name."""
    return [
        (path.name, ast.unparse(node))
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in functions
    ]


def test_the_package_never_executes_text() -> None:
    for path in (ROOT / "src" / "hprs").rglob("*.py"):
        assert calls_of(path, {"eval", "exec", "compile", "__import__"}) == []


def test_the_language_looks_up_no_attributes_by_a_name_of_the_user() -> None:
    lookups = {"getattr", "hasattr", "setattr", "delattr", "vars", "globals", "locals"}
    found = [
        call
        for path in (ROOT / "src" / "hprs" / "spec").glob("*.py")
        for call in calls_of(path, lookups)
    ]
    # Task.__post_init__ turns its own five fields into tuples.
    assert found == [("task.py", "getattr(self, name)")]
