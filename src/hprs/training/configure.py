"""Configures a training: everything that a user can say is checked here, once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.base import components_of, demands_of
from hprs.rewards.registry import REWARDS
from hprs.rewards.shaping import ENDS, End
from hprs.spec.expression import ExpressionLike
from hprs.training.algorithms import check_spaces, default_steps, find_algorithm
from hprs.training.configuration import Configuration
from hprs.training.environment import check_options, find_task, make_environment
from hprs.training.evaluation import FINAL_SEEDS, TRAINING_SEEDS
from hprs.training.parameters import known_parameters, resolve_parameters

_EVALUATIONS = 100
"""As many evaluations would be made at the JAX trainer's interval, if that stayed the same."""


def configure(
    environment: str,
    *,
    task_path: str | None = None,
    constants: Mapping[str, ExpressionLike] | None = None,
    reward: str = Configuration.reward,
    end: End = Configuration.end,
    reward_options: Mapping[str, Any] | None = None,
    algorithm: str | None = None,
    trainer: str | None = None,
    settings: Mapping[str, Any] | None = None,
    environment_options: Mapping[str, Any] | None = None,
    steps: int | None = None,
    horizon: int | None = None,
    evaluation_interval: int | None = None,
    evaluation_episodes: int = Configuration.evaluation_episodes,
    seed: int = Configuration.seed,
) -> Configuration:
    """A checked configuration of a training.

    Args:
        environment: Gymnasium id, or `module:id`.
        task_path: A task file; None: the benchmark's own task.
        constants: Other values for constants of the task.
        reward: A name of `REWARDS`.
        end: End-of-episode convention of the shaping; a reward without shaping ignores it.
        reward_options: The reward's own options, as JSON values.
        algorithm: One of `ALGORITHMS`; None: PPO.
        trainer: A key of `TRAINERS`; None: the JAX trainer where it has the algorithm.
        settings: Hyper-parameters that differ from the defaults.
        environment_options: Keyword arguments of `gymnasium.make`, as JSON values.
        steps: Environment steps; None: what the benchmark's file says.
        horizon: Truncate episodes after this many steps; None: as registered.
        evaluation_interval: Environment steps between two evaluations; None: the trainer's.
        evaluation_episodes: Episodes of an evaluation.
        seed: Seed of the training.

    Raises:
        UsageError: A name is unknown or a value out of range.
        SpecError: The task is wrong.
        SignalError: The environment lacks a signal of the task.
    """
    chosen = find_algorithm(algorithm, trainer)
    known = known_parameters(chosen)
    steps = default_steps(environment, chosen) if steps is None else steps
    if evaluation_interval is None:
        evaluation_interval = default_interval(chosen.trainer, chosen.name, steps)
    _check_counts(
        {
            "steps": steps,
            "horizon": horizon,
            "evaluation interval": evaluation_interval,
            "evaluation episodes": evaluation_episodes,
        }
    )
    if end not in ENDS:
        raise UsageError(
            f"unknown end '{end}'; choose one of {', '.join(ENDS)}.{did_you_mean(end, ENDS)}"
        )
    task, text = find_task(environment, task_path, constants)
    if not task.requirements:
        raise UsageError(
            f"the task {task_path or environment} has no requirement: it asks nothing."
        )
    options = dict(environment_options or {})
    check_options(environment, options)
    # Any discount will do to see that the reward exists and the environment has every signal.
    made = make_environment(
        environment,
        task,
        reward,
        end=end,
        discount=0.5,
        reward_options=reward_options,
        horizon=horizon,
        **options,
    )
    actions, observations = (type(s).__name__ for s in (made.action_space, made.observation_space))
    made.close()
    if components_of(made.reward) is not None:
        raise UsageError(
            f"the reward {reward} pays one number a requirement, and the trainers learn from one "
            "number. Train on morl, or use hprs.wrap with a multi-objective learner."
        )
    check_spaces(chosen, actions, observations)
    return Configuration(
        environment=environment,
        environment_options=options,
        task_text=text,
        trainer=chosen.trainer,
        algorithm=chosen.name,
        parameters=resolve_parameters(
            chosen,
            environment,
            settings or {},
            known,
            action_space=actions,
            demands=demands_of(made.reward),
        ),
        steps=steps,
        reward=reward,
        # One name for what is trained in one way.
        end=end if REWARDS[reward].shaped else ENDS[0],
        reward_options=dict(reward_options or {}),
        horizon=horizon,
        evaluation_interval=evaluation_interval,
        evaluation_episodes=evaluation_episodes,
        seed=seed,
    )


def default_interval(trainer: str, algorithm: str, steps: int) -> int:
    """Environment steps between two evaluations, where the user does not say how many."""
    often = max(1, steps // _EVALUATIONS)
    if trainer != "jax":
        return Configuration.evaluation_interval
    # A step of SAC costs as much as many of PPO, and an evaluation as little beside it.
    return often if algorithm == "ppo" else min(often, Configuration.evaluation_interval)


def _check_counts(counts: Mapping[str, int | None]) -> None:
    for name, value in counts.items():
        if value is not None and value < 1:
            raise UsageError(f"the {name} must be at least 1, got {value}.")
    if (counts["evaluation episodes"] or 0) > FINAL_SEEDS - TRAINING_SEEDS:
        raise UsageError(f"an evaluation has at most {FINAL_SEEDS - TRAINING_SEEDS:,} episodes.")
