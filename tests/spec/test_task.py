from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from hprs.errors import (
    MissingExtraError,
    Position,
    SpecError,
    SpecTypeError,
    SpecValidationError,
    UsageError,
    did_you_mean,
)
from hprs.rewards.registry import make_reward
from hprs.semantics.assessment import assess
from hprs.semantics.plan import Plan
from hprs.spec.expression import Name, Number
from hprs.spec.parser import parse_task
from hprs.spec.printer import format_task
from hprs.spec.task import (
    MAX_REQUIREMENTS,
    Constant,
    Definition,
    Preference,
    Requirement,
    Signal,
    Source,
    Task,
)
from tests.strategies import tasks

X = Name("x")


def test_a_task_can_be_built_in_python_with_lists() -> None:
    x = Signal("x", -1, 1, unit="m")
    mark = Constant("mark", 0.5)  # type: ignore[arg-type]
    off = Definition("off", abs(x - mark))
    built = Task(
        signals=[x],  # type: ignore[arg-type]
        constants=[mark],  # type: ignore[arg-type]
        definitions=[off],  # type: ignore[arg-type]
        requirements=[Requirement("conquer", "parked", off <= 0.25)],  # type: ignore[arg-type]
    )
    assert built == parse_task(
        'signal x in [-1, 1] "m"\nconst mark = 0.5\nlet off = abs(x - mark)\n'
        "conquer parked: off <= 0.25"
    )


@given(tasks())
def test_tasks_survive_copying_and_pickling(task: Task) -> None:
    for twin in (copy.deepcopy(task), pickle.loads(pickle.dumps(task))):
        assert twin == task
        assert hash(twin) == hash(task)


def test_a_pickled_task_hashes_anew_in_another_process() -> None:
    task = parse_task("signal x in [0, 1]\nensure a: x <= 0.5")
    assert hash(task) == hash(task)
    code = (
        "import pickle, sys; t = pickle.loads(sys.stdin.buffer.read()); u = type(t)(t.signals, "
        "t.requirements); print(t == u, hash(t) == hash(u))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], input=pickle.dumps(task), capture_output=True, check=True
    )
    assert run.stdout.split() == [b"True", b"True"]


def test_a_task_is_checked_even_without_assertions() -> None:
    code = "from hprs.spec.parser import parse_task; parse_task('ensure a: x <= 1')"
    run = subprocess.run([sys.executable, "-O", "-c", code], capture_output=True, check=False)
    assert b"unknown name 'x'" in run.stderr


def test_classes_labels_target_bounds_and_ranges_are_read_off() -> None:
    task = parse_task(
        "signal x in [0, 4]\nlet d = 2 * x\nensure a: x <= 3\n"
        "conquer b: d >= 6\nencourage c: x >= 1"
    )
    assert [r.requirement_class for r in task.requirements] == ["safety", "target", "comfort"]
    assert task.labels == ("a", "b", "c")
    assert task.target == task.requirements[1]
    assert task.bounds == {"a": (-1, 3), "b": (-6, 2), "c": (-1, 3)}
    assert (task.ranges["d"].low, task.ranges["d"].high) == (0, 8)
    assert task.remarks == ()
    assert Task().target is None


def test_margins_and_potential_of_a_state_are_at_hand() -> None:
    task = parse_task("signal x in [0, 4]\nconquer far: x >= 2")
    assert task.margins({"x": 1.0}) == {"far": -1.0}
    assert task.potential({"x": 1.0}) == 0.5


PARKING = """signal x in [-3, 3]
const mark = 1
const width = 0.25
let off = abs(x - mark)
conquer parked: off <= width
"""


def test_constants_are_parameters() -> None:
    task = parse_task(PARKING)
    other = task.with_constants(mark=-1.0, width=np.float32(0.5))
    assert other == parse_task(PARKING.replace("mark = 1", "mark = -1").replace("0.25", "0.5"))
    assert other.bounds == {"parked": (-3.5, 0.5)}
    assert other.margins({"x": -1.25}) == {"parked": 0.25}
    assert task.bounds == {"parked": (-3.75, 0.25)}
    assert task.with_constants() == task
    assert format_task(task.with_constants(mark=Number(90.0) * Name("deg"))).startswith(
        "const mark = 90 deg\nconst width = 0.25\n"
    )


def test_a_task_with_other_constants_is_checked_anew() -> None:
    task = parse_task(PARKING)
    assert task.remarks == ()
    assert "always satisfied" in task.with_constants(width=9).remarks[0].message
    with pytest.raises(SpecValidationError, match="'parked' can never be satisfied") as caught:
        task.with_constants(width=-1)
    assert caught.value.position == Position(5, 9, 6)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"markk": 1.0}, "the task has no constant 'markk'. Did you mean 'mark'?"),
        ({"off": 1.0}, "the task has no constant 'off'. It has mark, width."),
        ({"self": 1.0}, "the task has no constant 'self'."),
        ({"mark": float("nan")}, "finite"),
        ({"mark": float("inf")}, "inf may stand only at the end of a range"),
        ({"mark": Name("x")}, "unknown name 'x'|used before its declaration"),
        ({"mark": True}, "expected a number or an expression, got True"),
        ({"mark": "1"}, "expected a number or an expression, got '1'"),
    ],
)
def test_constants_that_a_task_cannot_have(values: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecValidationError, match=message):
        parse_task(PARKING).with_constants(**values)
    with pytest.raises(SpecValidationError, match=r"no constant 'mark'\. It has none\."):
        parse_task("signal x in [0, 1]").with_constants(mark=1)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Requirement("ensure", "near", X == 1), "requirement 'near' needs a comparison"),
        (lambda: Requirement("ensure", "near", X + 1), "needs a comparison such as x <= 1, got"),
        (lambda: Requirement("ensure", "near", "x <= 1"), "A text is read by hprs.parse_task"),
        (lambda: Task(requirements=["ensure near: x <= 1"]), "got 'ensure near: x <= 1'"),
        (lambda: Task(requirements=X <= 1), "the requirements of a task are a list"),
        (lambda: Task("task.hprs"), "got 'task.hprs'.*a file by hprs.load_task"),
        (lambda: Task(signals=Signal("x", 0, 1)), r"as in \[Signal\(\"x\", -1, 1\)\]; got Signal"),
        (lambda: Task(signals=[X]), "got Name"),
        (lambda: Task(constants={"mark": 1.0}), "got {'mark': 1.0}"),
        (lambda: Task(preferences=[("a", "b")]), r"got \('a', 'b'\)"),
        (lambda: Preference(Requirement("ensure", "a", X <= 1), "b"), "names two labels"),
        (lambda: Signal("x", 0, 1, source="obs[0]"), "source of signal 'x' is written Source"),
        (lambda: Signal("x", 0, 1, length="3"), "the length of signal 'x' is written 3, got '3'"),
        (lambda: Signal("x", 0, 1, length=True), "got True"),
        (lambda: Source("obs", (), 1.5), r"index of a source is written 0, or \(0, 2\).*got 1.5"),
        (lambda: Source("obs", (), True), "got True"),
        (lambda: Source("obs", (), slice(0, 2)), r"for the slice 0:2, got slice\(0, 2, None\)"),
        (lambda: Source("obs", (), (0, 1, 2)), r"got \(0, 1, 2\)"),
        (lambda: Source("obs", (), (0, 1.5)), r"got \(0, 1.5\)"),
        (lambda: Source("obs", "pose", 0), r'source are written \("pose", "x"\), got \'pose\''),
        (lambda: Source("obs", ("pose", 3), 0), r"got \('pose', 3\)"),
        (lambda: Signal("x", 0, 1, unit=None), "the unit of signal 'x' is written"),
        (lambda: Task([Signal(7, 0, 1)]), "a name is a text, got 7"),
        (
            lambda: Signal("x", [0] * 99, 1),
            r"expected a number or an expression, got \[0, .*\.\.\.",
        ),
    ],
)
def test_python_objects_of_the_wrong_kind_are_named(
    build: Callable[[], object], message: str
) -> None:
    with pytest.raises(SpecTypeError, match=message):
        build()


@pytest.mark.parametrize("value", ["task.hprs", {"a": 1}, None])
def test_where_a_task_is_needed_nothing_else_will_do(value: Any) -> None:
    uses = (format_task, lambda task: make_reward("hprs", task), lambda task: assess(task, {}))
    for use in (*uses, Plan):
        with pytest.raises(UsageError, match=r"a Task is needed here, got .*hprs.load_task\(path"):
            use(value)


def test_a_path_is_no_text_and_a_reward_has_a_name() -> None:
    with pytest.raises(SpecTypeError, match=r"got PurePosixPath.*read by hprs.load_task\(path\)"):
        parse_task(PurePosixPath("task.hprs"))  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="unknown reward '3'; choose one of hprs"):
        make_reward(3, Task())  # type: ignore[arg-type]
    with pytest.raises(SpecValidationError, match="a requirement is one of ensure"):
        Requirement(["ensure"], "a", X <= 1)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("source", "text"),
    [
        (Source("obs"), "obs"),
        (Source("obs", ("pose", "x"), 3), "obs.pose.x[3]"),
        (Source("action", (), -1), "action[-1]"),
        (Source("obs", (), (None, 3)), "obs[:3]"),
        (Source("obs", (), (-3, None)), "obs[-3:]"),
    ],
)
def test_a_source_shows_as_written(source: Source, text: str) -> None:
    assert str(source) == text


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Source("env"), "a source reads obs, action, last_action, info, not 'env'"),
        (lambda: Source("info"), "info is a dictionary: name its entry"),
        (lambda: Source("action", ("x",)), "action has no entries"),
        (lambda: Source("obs", ("two words",)), "the key 'two words' of a source is not a name"),
        (lambda: Source("obs", ("größe",)), "is not a name"),
        (lambda: Source("obs", (), 2_000_000), "an index goes from"),
        (lambda: Source("obs", (), (0, 2_000_000)), "an index goes from"),
        (lambda: Signal("x", 0, 1, length=0), "needs a length from 1 to 1000000, got 0"),
        (lambda: Signal("x", 0, 1, unit='"'), "neither quotes nor control characters"),
        (lambda: Signal("x", 0, 1, unit="a\nb"), "neither quotes nor control characters"),
        (lambda: Definition("d", X, Number(0.0)), "the range of 'd' needs both ends"),
        (lambda: Requirement("always", "a", X <= 1), "a requirement is one of ensure"),  # type: ignore[arg-type]
    ],
)
def test_statements_that_cannot_be_meant_are_refused(
    build: Callable[[], object], message: str
) -> None:
    with pytest.raises(SpecValidationError, match=message):
        build()


def test_the_numbers_of_requirements_and_preferences_are_bounded() -> None:
    requirements = tuple(
        Requirement("ensure", f"r{i}", Name("x") <= 0.5) for i in range(MAX_REQUIREMENTS)
    )
    x = Signal("x", 0, 1)
    assert len(Task((x,), requirements).labels) == MAX_REQUIREMENTS
    with pytest.raises(SpecValidationError, match="may have 500 requirements, got 501"):
        Task((x,), (*requirements, Requirement("ensure", "last", X <= 0.5)))
    with pytest.raises(SpecValidationError, match="may have 500 preferences, got 501"):
        Task((x,), requirements, preferences=(Preference("r0", "r1"),) * 501)


def test_errors_without_a_text_show_what_is_known() -> None:
    place = Position(2, 3)
    assert str(SpecError("Bad.")) == "Bad."
    assert str(SpecError("Bad.", path="a.hprs")) == "a.hprs: Bad."
    assert str(SpecError("Bad.", place)) == "task:2:3: Bad."
    assert str(SpecError("Bad.", place, path="a.hprs")) == "a.hprs:2:3: Bad."
    assert str(SpecError("Bad.", place, text="one line")).splitlines()[1:] == [
        "    2 | ",
        "      |   ^",
    ]


def test_a_missing_package_comes_with_the_command_that_installs_it() -> None:
    error = MissingExtraError("torch", "sb3")
    assert str(error) == "torch is not installed. Install it with: pip install 'hprs[sb3]'"


def test_suggestions_come_for_close_names_only() -> None:
    assert did_you_mean("thetta", ["theta", "x"]) == " Did you mean 'theta'?"
    assert did_you_mean("speed", ["theta", "x"]) == ""
