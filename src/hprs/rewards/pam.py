"""The policy assessment metric, paid at the end of an episode (the paper's PAM, as a reward)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

from hprs.rewards.base import PAID_AT_THE_END, Demands, paid_at_the_end
from hprs.semantics import assessment
from hprs.semantics.assessment import Tally
from hprs.semantics.evaluation import Signals, evaluate, is_single
from hprs.semantics.plan import plan_of
from hprs.spec.namespace import Array, namespace_of
from hprs.spec.task import Task


@dataclass(frozen=True)
class EpisodeAssessment:
    """PAM of the episode, from 0 to 1.75, once, where it ends for whatever reason.

    The number that `hprs.assess` gives. The paper assesses by it and trains on nothing like it.

    Args:
        task: The task.
    """

    task: Task
    demands: ClassVar[Demands] = PAID_AT_THE_END

    def init(self, signals: Signals) -> Tally:
        """The tally of s_0."""
        evaluation = evaluate(self.task, signals)
        tally = assessment.start(plan_of(self.task), evaluation.satisfied)
        return tally if is_single(evaluation) else _batch_first(tally)

    def step(
        self, memory: Tally, signals: Signals, terminated: Array, truncated: Array
    ) -> tuple[Tally, Array]:
        """The tally so far; PAM, where the episode ends."""
        evaluation = evaluate(self.task, signals)
        single = is_single(evaluation)
        before = memory if single else _batch_last(memory)
        tally = assessment.advance(plan_of(self.task), before, evaluation.satisfied)
        tally = tally if single else _batch_first(tally)
        worth = self._of_state if single else self._of_batch
        return tally, paid_at_the_end(worth, tally, terminated, truncated)

    def _of_state(self, *tally: Any) -> Array:
        return assessment.conclude(plan_of(self.task), Tally(*tally)).pam

    def _of_batch(self, *tally: Any) -> Array:
        return assessment.conclude(plan_of(self.task), _batch_last(Tally(*tally))).pam


def _moved(tally: Tally, source: int, destination: int) -> Tally:
    """A tally with the requirements on another axis: memories have the batch first."""
    xp = namespace_of((tally.safe,))

    def move(rows: Any) -> Any:
        return xp.moveaxis(rows, source, destination)

    return tally._replace(safe=move(tally.safe), counts=move(tally.counts))


_batch_first = partial(_moved, source=0, destination=-1)
_batch_last = partial(_moved, source=-1, destination=0)
