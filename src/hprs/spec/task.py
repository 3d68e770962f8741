"""A task: signals, constants, definitions and requirements with their order, as frozen data.

`Task(...)` checks everything that can be known without an environment, so that a task that exists
is a task that can be evaluated. What it derives is in `task.analysis` and `task.order`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

from hprs.errors import Position, SpecTypeError, SpecValidationError, UsageError, did_you_mean
from hprs.spec.expression import ExpressionLike, as_expression, position_field
from hprs.spec.interval import Interval
from hprs.spec.misuse import shown
from hprs.spec.statements import Constant as Constant
from hprs.spec.statements import Definition as Definition
from hprs.spec.statements import Preference as Preference
from hprs.spec.statements import Requirement as Requirement
from hprs.spec.statements import Signal as Signal
from hprs.spec.statements import Source as Source
from hprs.spec.vocabulary import ENV_REWARD as ENV_REWARD

if TYPE_CHECKING:
    from hprs.spec.analysis import Analysis
    from hprs.spec.order import Order

MAX_REQUIREMENTS = 500
"""Most requirements, and most preferences; the order grows with their square."""


@dataclass(frozen=True)
class Task:
    """What a robot must do.

    A name may be used only after the declaration it refers to, in the order constants, signals,
    definitions, requirements.

    Raises:
        SpecValidationError: A name is unknown, reserved or declared twice; a range, an operation, a
            requirement or the order cannot be meant. The message says which and what to do.
    """

    signals: tuple[Signal, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    constants: tuple[Constant, ...] = ()
    definitions: tuple[Definition, ...] = ()
    preferences: tuple[Preference, ...] = ()

    def __post_init__(self) -> None:
        """Freeze sequences into tuples and check the whole task."""
        for name, (kind, advice) in _STATEMENTS.items():
            object.__setattr__(self, name, _frozen(name, kind, advice, getattr(self, name)))
        if len(self.requirements) > MAX_REQUIREMENTS:
            raise SpecValidationError(
                f"a task may have {MAX_REQUIREMENTS} requirements, got {len(self.requirements)}.",
                self.requirements[MAX_REQUIREMENTS].position,
            )
        if len(self.preferences) > MAX_REQUIREMENTS:
            raise SpecValidationError(
                f"a task may have {MAX_REQUIREMENTS} preferences, got {len(self.preferences)}.",
                self.preferences[MAX_REQUIREMENTS].position,
            )
        _ = (self.analysis, self.order)

    def with_constants(self, /, **values: ExpressionLike) -> Task:
        """The task with other values of some of its constants, analysed anew.

        Args:
            **values: Name of a constant to its value: a number or a constant expression.

        Raises:
            SpecValidationError: There is no such constant, a value is not finite, or the task
                cannot be meant with these values.
        """
        known = {constant.name for constant in self.constants}
        for name in values:
            if name not in known:
                offer = f" It has {', '.join(sorted(known))}." if known else " It has none."
                raise SpecValidationError(
                    f"the task has no constant '{name}'.{did_you_mean(name, known) or offer}"
                )
        constants = tuple(
            replace(constant, value=as_expression(values[constant.name]))
            if constant.name in values
            else constant
            for constant in self.constants
        )
        return replace(self, constants=constants)

    def __reduce__(self) -> tuple[type[Task], tuple[Any, ...]]:
        """Pickle the fields alone: a cached hash means nothing in another process."""
        return Task, (
            self.signals,
            self.requirements,
            self.constants,
            self.definitions,
            self.preferences,
        )

    def __hash__(self) -> int:
        """Structural hash, computed once: tasks are keys of caches."""
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash(
            (
                self.signals,
                self.requirements,
                self.constants,
                self.definitions,
                self.preferences,
            )
        )

    @cached_property
    def analysis(self) -> Analysis:
        """Shapes, ranges, bounds and warnings."""
        from hprs.spec.analysis import analyse

        return analyse(self)

    @cached_property
    def order(self) -> Order:
        """The strict partial order of importance."""
        from hprs.spec.order import order_of

        return order_of(self)

    @property
    def labels(self) -> tuple[str, ...]:
        """The requirements' labels in the order of the text."""
        return tuple(requirement.label for requirement in self.requirements)

    @property
    def target(self) -> Requirement | None:
        """The target requirement, if there is one."""
        return next((r for r in self.requirements if r.requirement_class == "target"), None)

    @property
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Label to (l, u), the smallest and largest margin that the signals' ranges allow."""
        return {label: (bound.low, bound.high) for label, bound in self.analysis.bounds.items()}

    def margins(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Label to margin f in a state or a batch of states; positive where satisfied.

        Args:
            signals: Name to float, or to NumPy, JAX or PyTorch arrays of any batch shape.
        """
        from hprs.semantics.evaluation import margins

        return margins(self, signals)

    def potential(self, signals: Mapping[str, Any]) -> Any:
        """The hierarchical potential Psi of a state or a batch of states; see `margins`."""
        from hprs.semantics.evaluation import potential

        return potential(self, signals)

    @property
    def ranges(self) -> Mapping[str, Interval]:
        """Signal name to its range."""
        return self.analysis.ranges

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What is legal and probably not meant."""
        return self.analysis.remarks


_STATEMENTS: Mapping[str, tuple[type[Any], str]] = {
    "signals": (Signal, 'Signal("x", -1, 1)'),
    "requirements": (Requirement, 'Requirement("ensure", "near", x <= 1)'),
    "constants": (Constant, 'Constant("mark", 1.0)'),
    "definitions": (Definition, 'Definition("off", abs(x - mark))'),
    "preferences": (Preference, 'Preference("near", "slow")'),
}
"""Field of a task to what it holds, and how that is written in Python."""


def _frozen(field: str, kind: type[Any], example: str, given: object) -> tuple[Any, ...]:
    """What was given for a field of a task, as a tuple of statements of its kind."""
    wrong: object = given
    if isinstance(given, Iterable) and not isinstance(given, str | Mapping):
        statements: tuple[object, ...] = tuple(cast("Iterable[object]", given))
        if all(isinstance(statement, kind) for statement in statements):
            return statements
        wrong = next(part for part in statements if not isinstance(part, kind))
    raise SpecTypeError(
        f"the {field} of a task are a list of {kind.__name__}, as in [{example}]; got "
        f"{shown(wrong)}. A task's text is read by hprs.parse_task, a file by hprs.load_task."
    )


def require_task(value: object) -> Task:
    """The value, if it is a task.

    Raises:
        UsageError: It is something else.
    """
    if isinstance(value, Task):
        return value
    advice = "Read it with hprs.load_task(path) or hprs.parse_task(text)."
    raise UsageError(f"a Task is needed here, got {shown(value)}. {advice}")


@dataclass(frozen=True)
class Remark:
    """A remark on a task that is legal and probably not meant."""

    message: str
    position: Position | None = position_field()
