"""One reward a requirement, for multi-objective learners (the convention of MO-Gymnasium)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.shaping import DEFAULT_END, End, check_convention, potential_difference
from hprs.rewards.state import base_reward
from hprs.semantics.evaluation import Signals, evaluate, is_single
from hprs.semantics.plan import Evaluation, plan_of
from hprs.spec.misuse import shown
from hprs.spec.namespace import Array, namespace_of
from hprs.spec.task import Task

ComponentForm: TypeAlias = Literal["difference", "score"]
COMPONENT_FORMS: tuple[ComponentForm, ...] = get_args(ComponentForm)
"""What a component pays; see `RequirementVector`."""


@dataclass(frozen=True)
class RequirementVector:
    """One number a requirement, in the order of the text, on the last axis.

    `form` says what each component pays:

    - `"difference"`: base reward plus the requirement's own potential difference, so that weights
      that add up to 1 make the MORL reward of it (multi-objectivization; Brys et al., 2014).
    - `"score"`: the requirement's score in the state reached, so that a component's sum says how
      long and how well its requirement was met.

    Args:
        task: The task.
        form: One of these.
        end: The convention at the end of an episode; see `hprs.rewards.shaping`.
        discount: The learner's discount in (0, 1]; `"invariant"` needs it, the others ignore it.

    Raises:
        UsageError: Unknown `form` or `end`, or a discount that is missing or outside (0, 1].
    """

    task: Task
    form: ComponentForm = "difference"
    end: End = DEFAULT_END
    discount: float | None = None

    def __post_init__(self) -> None:
        """Check form and convention."""
        if self.form not in COMPONENT_FORMS:
            raise UsageError(
                f"components are {' or '.join(COMPONENT_FORMS)}, got {shown(self.form)}."
                f"{did_you_mean(str(self.form), COMPONENT_FORMS)}"
            )
        check_convention(self.end, self.discount)

    @property
    def components(self) -> tuple[str, ...]:
        """Labels of the components."""
        return self.task.labels

    def init(self, signals: Signals) -> Array:
        """The scores of s_0."""
        return self._scores(evaluate(self.task, signals))

    def step(
        self, memory: Array, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[Array, Array]:
        """The scores of s', and the rewards of the transition into it."""
        evaluation = evaluate(self.task, signals)
        scores = self._scores(evaluation)
        if self.form == "score":
            return scores, scores
        shaping = potential_difference(
            self.end,
            self.discount,
            memory,
            scores,
            terminated=_spread(terminated),
            truncated=_spread(truncated),
        )
        return scores, _spread(base_reward(plan_of(self.task).target_row, evaluation)) + shaping

    @cached_property
    def _order(self) -> tuple[int, ...]:
        """The plan's rows in the order of the text."""
        labels = plan_of(self.task).labels
        return tuple([labels.index(label) for label in self.task.labels])

    def _scores(self, evaluation: Evaluation) -> Array:
        if is_single(evaluation):
            scores = list(evaluation.scores.values())
            return np.asarray([scores[row] for row in self._order])
        rows = [evaluation.scores[row] for row in self._order]
        return namespace_of(rows).stack(rows, axis=-1)


def _spread(value: Any) -> Any:
    """A batch with one more axis at the end, a single value as it is."""
    return value if isinstance(value, bool | float) else value[..., None]
