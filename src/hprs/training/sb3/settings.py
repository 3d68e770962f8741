"""Configures a training: everything that a user can say is checked here, once."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from hprs.errors import UsageError, did_you_mean
from hprs.rewards.base import components_of, demands_of
from hprs.rewards.shaping import ENDS, End
from hprs.spec.expression import ExpressionLike
from hprs.training import algorithms
from hprs.training.configuration import Configuration
from hprs.training.environment import check_options, find_task, make_environment, require
from hprs.training.evaluation import FINAL_SEEDS, TRAINING_SEEDS

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

_NOT_HYPERPARAMETERS = frozenset(
    {
        "self",
        "policy",
        "env",
        "action_noise",
        "replay_buffer_class",
        "rollout_buffer_class",
        # It would also need `handle_timeout_termination` off, which bootstraps at no horizon.
        "optimize_memory_usage",
        "tensorboard_log",
        "verbose",
        "seed",
        "device",
        "_init_setup_model",
    }
)


def configure(
    environment: str,
    *,
    task_path: str | None = None,
    constants: Mapping[str, ExpressionLike] | None = None,
    reward: str = Configuration.reward,
    end: End = Configuration.end,
    reward_options: Mapping[str, Any] | None = None,
    algorithm: str | None = None,
    settings: Mapping[str, Any] | None = None,
    environment_options: Mapping[str, Any] | None = None,
    steps: int | None = None,
    horizon: int | None = None,
    evaluation_interval: int = Configuration.evaluation_interval,
    evaluation_episodes: int = Configuration.evaluation_episodes,
    seed: int = Configuration.seed,
) -> Configuration:
    """A checked configuration of a training.

    Args:
        environment: Gymnasium id, or `module:id`.
        task_path: A task file; None: the benchmark's own task.
        constants: Other values for constants of the task.
        reward: A name of `REWARDS`.
        end: End-of-episode convention of the shaping.
        reward_options: The reward's own options, as JSON values.
        algorithm: A name of `ALGORITHMS`; None: the benchmark's, or what suits the action space.
        settings: Hyper-parameters that differ from the defaults.
        environment_options: Keyword arguments of `gymnasium.make`, as JSON values.
        steps: Environment steps; None: what the benchmark's file says.
        horizon: Truncate episodes after this many steps; None: as registered.
        evaluation_interval: Environment steps between two evaluations.
        evaluation_episodes: Episodes of an evaluation.
        seed: Seed of the training.

    Raises:
        UsageError: A name is unknown or a value out of range.
        SpecError: The task is wrong.
        SignalError: The environment lacks a signal of the task.
    """
    stable_baselines3 = require("stable_baselines3", "sb3")
    steps = algorithms.default_steps(environment) if steps is None else steps
    counts = {
        "steps": steps,
        "horizon": horizon,
        "evaluation interval": evaluation_interval,
        "evaluation episodes": evaluation_episodes,
    }
    for name, value in counts.items():
        if value is not None and value < 1:
            raise UsageError(f"the {name} must be at least 1, got {value}.")
    if evaluation_episodes > FINAL_SEEDS - TRAINING_SEEDS:
        raise UsageError(f"an evaluation has at most {FINAL_SEEDS - TRAINING_SEEDS:,} episodes.")
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
    if components_of(made.reward) is not None:
        made.close()
        raise UsageError(
            f"the reward {reward} pays one number a requirement, and Stable-Baselines3 learns from "
            "one number. Train on morl, or use hprs.wrap with a multi-objective learner."
        )
    space = type(made.action_space).__name__
    chosen = algorithms.find_algorithm(algorithm, space, environment)
    made.close()
    own = hyperparameters(getattr(stable_baselines3, chosen.class_name))
    return Configuration(
        environment=environment,
        environment_options=options,
        task_text=text,
        algorithm=chosen.name,
        parameters=algorithms.resolve_parameters(
            chosen,
            environment,
            settings or {},
            own,
            action_space=space,
            demands=demands_of(made.reward),
        ),
        steps=steps,
        reward=reward,
        end=end,
        reward_options=dict(reward_options or {}),
        horizon=horizon,
        evaluation_interval=evaluation_interval,
        evaluation_episodes=evaluation_episodes,
        seed=seed,
    )


def hyperparameters(kind: type[BaseAlgorithm]) -> dict[str, tuple[Any, Any]]:
    """An algorithm's own arguments that a user may set: name to annotation and default."""
    return {
        name: (parameter.annotation, parameter.default)
        for name, parameter in inspect.signature(kind.__init__).parameters.items()
        if name not in _NOT_HYPERPARAMETERS
    }
