"""What each requirement adds to the hierarchical potential.

The potential is a sum over the requirements: each adds its score, times the scores of all that are
strictly more important (the paper, equation `hrs_pot`).
"""

from __future__ import annotations

from collections.abc import Sequence

from hprs.semantics.evaluation import Signals, evaluate, is_single
from hprs.semantics.plan import Evaluation, plan_of
from hprs.spec.namespace import Array
from hprs.spec.task import Task


def contributions(task: Task, signals: Signals) -> dict[str, Array]:
    """Label to the requirement's term of the potential, of a state or a batch of states.

    Their sum is the potential, up to rounding: so the sum of their changes over a transition is the
    `"paper"` convention's shaping.

    Raises:
        SignalError: A signal that the task uses is missing, or signals are no dictionary.
    """
    return plan_of(task).by_label(evaluated_contributions(task, evaluate(task, signals)))


def evaluated_contributions(task: Task, evaluation: Evaluation) -> list[Array]:
    """One term a row of the plan, of a state or a batch of states that is evaluated already."""
    plan = plan_of(task)
    single = is_single(evaluation)
    scores: Sequence[Array] = list(evaluation.scores.values()) if single else evaluation.scores
    terms: dict[int, Array] = {}
    for group in plan.groups:
        for row in group.members:
            term = scores[row]
            for above in group.above:
                term = term * scores[above]
            terms[row] = term
    return [terms[row] for row in range(len(plan.rows))]
