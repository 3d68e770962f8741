"""Rewards by name: the one place that knows which exist, and which options each of them has."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.base import NO_DEMANDS, Demands, Reward
from hprs.rewards.bhnr import WindowRobustness, check_window, default_window, is_count
from hprs.rewards.hierarchical import Hierarchical
from hprs.rewards.pam import EpisodeAssessment
from hprs.rewards.rank_preserving import RankPreserving
from hprs.rewards.scalarized import Scalarized, Weights, decreasing_weights, uniform_weights
from hprs.rewards.shaping import DEFAULT_END, End, check_convention
from hprs.rewards.state import environment_reward, sparse
from hprs.rewards.tltl import EpisodeRobustness
from hprs.rewards.vector import RequirementVector
from hprs.spec.misuse import shown
from hprs.spec.task import Task, require_task


class Context(NamedTuple):
    """What a reward may need to know of whoever learns from it, and where."""

    end: End = DEFAULT_END
    """End-of-episode convention of potential-based rewards."""
    discount: float | None = None
    """The learner's discount."""
    horizon: int | None = None
    """Steps after which the environment truncates an episode."""


@dataclass(frozen=True)
class RewardKind:
    """A reward that has a name."""

    make: Callable[..., Reward]
    """A function of the task, a `Context` and, by keyword, the options."""
    options: tuple[str, ...] = ()
    """What else can be said of it."""
    shaped: bool = False
    """Whether it has a convention for the end of an episode."""
    demands: Demands = NO_DEMANDS
    """What it asks of the learner, whatever the task and the options."""


def _hierarchical(task: Task, context: Context) -> Reward:
    return Hierarchical(task, context.end, context.discount)


def _without_comfort(task: Task, context: Context) -> Reward:
    return Hierarchical(task, context.end, context.discount, comfort=False)


def _sparse(task: Task, context: Context) -> Reward:
    del context
    return sparse(task)


def _environment(task: Task, context: Context) -> Reward:
    del context
    return environment_reward(task)


def _weighted(task: Task, context: Context, *, weights: Weights | None = None) -> Reward:
    if weights is None:
        give = f"one number for each of {', '.join(task.labels)}"
        raise _missing("morl", "weights", give)
    return Scalarized(task, weights, context.end, context.discount)


def _uniform(task: Task, context: Context) -> Reward:
    return _weighted(task, context, weights=uniform_weights(task))


def _decreasing(task: Task, context: Context) -> Reward:
    return _weighted(task, context, weights=decreasing_weights(task))


def _tltl(task: Task, context: Context, **options: Any) -> Reward:
    del context
    return EpisodeRobustness(task, **options)


def _bhnr(task: Task, context: Context, *, window: int | None = None, **options: Any) -> Reward:
    horizon = context.horizon
    if window is None:
        if horizon is None:
            give = "a number of states, because the horizon of the episodes is not known here"
            raise _missing("bhnr", "window", give)
        window = default_window(horizon)
    check_window(window, horizon)
    return WindowRobustness(task, window, **options)


def _rank_preserving(task: Task, context: Context, **options: Any) -> Reward:
    del context
    return RankPreserving(task, **options)


def _pam(task: Task, context: Context) -> Reward:
    del context
    return EpisodeAssessment(task)


def _vector(task: Task, context: Context, **options: Any) -> Reward:
    return RequirementVector(task, end=context.end, discount=context.discount, **options)


def _missing(reward: str, option: str, give: str) -> UsageError:
    """The error of an option that cannot be left out here."""
    return UsageError(f"the reward {reward} needs the option {option}: {give}.")


REWARDS: Mapping[str, RewardKind] = MappingProxyType(
    {
        "hprs": RewardKind(_hierarchical, shaped=True),
        "hprs-no-comfort": RewardKind(_without_comfort, shaped=True),
        "sparse": RewardKind(_sparse),
        "env": RewardKind(_environment),
        "morl": RewardKind(_weighted, ("weights",), shaped=True),
        "morl-uniform": RewardKind(_uniform, shaped=True),
        "morl-decreasing": RewardKind(_decreasing, shaped=True),
        "tltl": RewardKind(_tltl, ("margins",), demands=EpisodeRobustness.demands),
        "bhnr": RewardKind(_bhnr, ("window", "form")),
        "rank-preserving": RewardKind(
            _rank_preserving, ("base", "margins"), demands=RankPreserving.demands
        ),
        "pam": RewardKind(_pam, demands=EpisodeAssessment.demands),
        "vector": RewardKind(_vector, ("form",), shaped=True),
    }
)
"""Name to reward."""


def reward_kind(name: str) -> RewardKind:
    """What is known of a reward by its name alone.

    Raises:
        UsageError: There is none of that name.
    """
    if name not in tuple(REWARDS):
        raise UsageError(
            f"unknown reward '{name}'; choose one of {', '.join(REWARDS)}."
            f"{did_you_mean(str(name), REWARDS)}"
        )
    return REWARDS[name]


def make_reward(
    name: str,
    task: Task,
    *,
    end: End = DEFAULT_END,
    discount: float | None = None,
    horizon: int | None = None,
    **options: Any,
) -> Reward:
    """A reward by name.

    Args:
        name: One of `REWARDS`.
        task: The task it is derived from.
        end: End-of-episode convention of potential-based rewards; see `hprs.rewards.shaping`.
        discount: The learner's discount; `end="invariant"` needs it.
        horizon: Steps after which the environment truncates an episode; `bhnr` takes a twentieth of
            it as its window unless told otherwise.
        **options: The reward's own options, as docs/rewards.md lists them.

    Raises:
        UsageError: The name, the convention or an option is unknown, a value is wrong or missing,
            or what is given as the task is none.
    """
    kind = reward_kind(name)
    check_convention(end, discount)
    require_task(task)
    for option in options:
        if option not in kind.options:
            offer = f" It has {', '.join(kind.options)}." if kind.options else " It has none."
            raise UsageError(
                f"the reward {name} has no option '{option}'."
                f"{did_you_mean(option, kind.options) or offer}"
            )
    return kind.make(task, Context(end, discount, _checked_horizon(horizon)), **options)


def _checked_horizon(horizon: int | None) -> int | None:
    if horizon is None:
        return None
    if not is_count(horizon):
        raise UsageError(f"the horizon is a whole number of steps from 1 on, got {shown(horizon)}.")
    return int(horizon)
