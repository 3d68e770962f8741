"""BHNR: filtering semantics over the last states, at every step.

After Balakrishnan and Deshmukh (2019), who call it bounded-horizon nominal robustness; the
filtering semantics is that of Rodionova et al. (2016).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from numbers import Integral
from typing import Any, Literal, TypeAlias, get_args

from hprs.errors import UsageError, did_you_mean
from hprs.semantics.evaluation import Signals
from hprs.semantics.plan import plan_of
from hprs.semantics.robustness import (
    Follower,
    Operator,
    check_margin_form,
    formula,
    least_of,
    require_formula,
)
from hprs.semantics.window import ALL, LEAST, MEAN, MEAN_OF_MINIMA, RUN, Filter
from hprs.spec.misuse import shown
from hprs.spec.namespace import Array
from hprs.spec.task import Task

WindowForm: TypeAlias = Literal["quantitative", "boolean"]
WINDOW_FORMS: tuple[WindowForm, ...] = get_args(WindowForm)
"""What a state counts: its normalised margin, or 1 where the requirement holds and 0 elsewhere."""

WINDOWS_A_HORIZON = 20
"""The released code's windows are this part of an episode long."""


@dataclass(frozen=True)
class WindowRobustness:
    """Filtering semantics of "always safe, and eventually on target" over the last states.

    Always is the minimum over the window's remainder, eventually the sum over the remainder divided
    by the window's number N of states, both read at its first position; the whole is the minimum.
    So `ensure` gives the least margin of the window, `achieve` the mean margin, `conquer` the mean
    over the positions of the least margin from there on. Comfort is not in the formula. While an
    episode has fewer states than the window, N is their number, s_0 included.

    The quantitative form takes margins normalised to [-1, 1]. The boolean form is that of the
    released code: strictness matters in it, and the reward lies in [0, 1].

    Args:
        task: The task.
        window: Length H of the window in states, which are control steps.
        form: Quantitative or boolean.

    Raises:
        UsageError: The window is no whole number from 1 on, the form is unknown, the task has
            neither safety nor target requirements, or a margin has no bounds to normalise it by.
    """

    task: Task
    window: int
    form: WindowForm = "quantitative"

    def __post_init__(self) -> None:
        """Check window, form and task."""
        require_window(self.window)
        if self.form not in WINDOW_FORMS:
            raise UsageError(
                f"form is {' or '.join(WINDOW_FORMS)}, got {shown(self.form)}."
                f"{did_you_mean(str(self.form), WINDOW_FORMS)}"
            )
        require_formula(self.task, "bhnr")
        if self.form == "quantitative":
            count = plan_of(self.task).comfort_start
            check_margin_form(self.task, "normalised", rows=count, instead="form='boolean'")

    @cached_property
    def _follower(self) -> Follower:
        form = "normalised" if self.form == "quantitative" else "truth"
        return Follower(self.task, formula(self.task), form)

    def init(self, signals: Signals) -> tuple[Any, ...]:
        """Windows of s_0 alone."""
        values, size = self._follower.now(signals), self.window
        return tuple(
            [
                filter.begin(value, size)
                for filter, value in zip(_filters(self.task, self.form), values, strict=True)
            ]
        )

    def step(
        self, memory: tuple[Any, ...], signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[tuple[Any, ...], Array]:
        """The windows one state later, and what they are worth."""
        del terminated, truncated
        values, size = self._follower.now(signals), self.window
        windows: list[Any] = []
        for index, filter in enumerate(_filters(self.task, self.form)):
            window = filter.push(memory[index], values[index], size)
            windows.append(window)
            values[index] = filter.value(window, size)
        return tuple(windows), least_of(values)


@lru_cache(maxsize=256)
def _filters(task: Task, form: WindowForm) -> tuple[Filter, ...]:
    """The filters of the parts of a task's formula."""
    filters: dict[Operator, Filter] = {
        "always": ALL if form == "boolean" else LEAST,
        "eventually": MEAN,
        "eventually always": RUN if form == "boolean" else MEAN_OF_MINIMA,
    }
    return tuple([filters[part.operator] for part in formula(task)])


def is_count(steps: object) -> bool:
    """Whether something is a whole number from 1 on; a truth value is none."""
    return not isinstance(steps, bool) and isinstance(steps, Integral) and int(steps) >= 1


def require_window(window: object) -> None:
    """Refuse what is no length of a window.

    Raises:
        UsageError: It is no whole number from 1 on.
    """
    if not is_count(window):
        raise UsageError(f"window is a whole number of steps from 1 on, got {shown(window)}.")


def default_window(horizon: int) -> int:
    """The length of the window where none is asked for."""
    return max(1, horizon // WINDOWS_A_HORIZON)


def check_window(window: int, horizon: int | None) -> None:
    """Refuse a window that no episode fills.

    Raises:
        UsageError: It is no whole number from 1 on, or above the horizon, if that is known.
    """
    require_window(window)
    if horizon is not None and window > horizon:
        raise UsageError(f"window must be at most the horizon of {horizon} steps, got {window}.")
