"""Finds environments and tasks by name, and puts one on the other."""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym

import hprs.envs
from hprs.errors import MissingExtraError, UsageError, did_you_mean
from hprs.rewards.shaping import DEFAULT_END, End
from hprs.spec.expression import ExpressionLike
from hprs.spec.parameters import override
from hprs.spec.parser import parse_task
from hprs.spec.printer import format_task
from hprs.spec.task import Task
from hprs.spec.task_file import normalised, read_text
from hprs.training.configuration import Configuration
from hprs.wrappers.single import TaskWrapper, wrap

TASK_SUFFIX = ".hprs"

_OUR_OPTIONS = {"max_episode_steps": "--horizon", "render_mode": "", "disable_env_checker": ""}
"""Arguments of `gymnasium.make` that are not the environment's own, and what sets them here."""


def make_bare(environment: str, *, horizon: int | None = None, **options: Any) -> gym.Env[Any, Any]:
    """An environment without a task.

    Args:
        environment: Gymnasium id; `module:id` imports the module first.
        horizon: Truncate episodes after this many steps; None: as registered.
        **options: Passed to `gymnasium.make`.

    Raises:
        UsageError: There is no such environment.
    """
    module, colon, name = environment.rpartition(":")
    if colon:
        _import(module, environment)
    try:
        return gym.make(name, max_episode_steps=horizon, **options)
    except gym.error.DependencyNotInstalled as error:
        raise UsageError(f"{environment} needs a package that is not installed: {error}") from None
    except gym.error.Error as error:
        raise UsageError(
            f"unknown environment '{environment}'."
            f"{did_you_mean(name, gym.registry) or ' `hprs tasks` lists the built-in ones.'}"
        ) from error


def check_options(environment: str, options: Mapping[str, Any]) -> None:
    """See that an environment takes these options.

    Args:
        environment: Gymnasium id, or `module:id`.
        options: Name to value, as in `gymnasium.make`.

    Raises:
        UsageError: It does not know one, or refuses a value.
    """
    if not options:
        return
    made = make_bare(environment)
    parameters = inspect.signature(type(made.unwrapped).__init__).parameters.values()
    made.close()
    known = [p.name for p in parameters if p.kind in (p.KEYWORD_ONLY, p.POSITIONAL_OR_KEYWORD)]
    known = [name for name in known if name != "self" and name not in _OUR_OPTIONS]
    anything = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters)
    for name in options:
        if name in _OUR_OPTIONS or (name not in known and not anything):
            instead = f" Use {_OUR_OPTIONS[name]}." if _OUR_OPTIONS.get(name) else ""
            offer = f" It has {', '.join(known)}." if known else " It has none."
            raise UsageError(
                f"{environment} has no option '{name}'."
                f"{instead or did_you_mean(name, known) or offer}"
            )
    try:
        make_bare(environment, **options).close()
    except (TypeError, ValueError, AssertionError) as error:
        if isinstance(error, UsageError):
            raise
        given = ", ".join(f"{name}={value!r}" for name, value in options.items())
        raise UsageError(f"{environment} refuses its options {given}: {error}") from error


def make_environment(
    environment: str,
    task: Task,
    reward: str = Configuration.reward,
    *,
    end: End = DEFAULT_END,
    discount: float | None = None,
    reward_options: Mapping[str, Any] | None = None,
    horizon: int | None = None,
    **options: Any,
) -> TaskWrapper:
    """An environment with a task on it.

    Raises:
        UsageError: The environment or the reward is unknown, or episodes have no horizon.
        SignalError: The environment lacks a signal of the task.
    """
    bare = make_bare(environment, horizon=horizon, **options)
    if bare.spec is None or bare.spec.max_episode_steps is None:
        bare.close()
        # Whether an episode ends by itself nobody can know, and an evaluation would wait for it.
        raise UsageError(f"{environment} has no horizon of its own. Give it one: --horizon N")
    return wrap(bare, task, reward, end=end, discount=discount, reward_options=reward_options)


def make_configured(configuration: Configuration, **options: Any) -> TaskWrapper:
    """The environment of a training."""
    return make_environment(
        configuration.environment,
        configuration.task,
        configuration.reward,
        end=configuration.end,
        discount=configuration.discount,
        reward_options=configuration.reward_options,
        horizon=configuration.horizon,
        **{**configuration.environment_options, **options},
    )


def find_task(
    environment: str,
    path: str | None = None,
    constants: Mapping[str, ExpressionLike] | None = None,
) -> tuple[Task, str]:
    """A task and its text: from a file, or the benchmark's own.

    Args:
        environment: Gymnasium id, or `module:id`.
        path: A task file; None: the benchmark's own task.
        constants: Other values for constants of the task; its text then has them.

    Raises:
        UsageError: There is no such file, or the environment has no task of its own.
        SpecError: The task is wrong, or has no such constant.
    """
    task, text = _named_task(environment, path)
    if not constants:
        return task, text
    task = override(task, constants, path=path or environment)
    return task, format_task(task)


def _named_task(environment: str, path: str | None) -> tuple[Task, str]:
    if path is not None:
        return read_task(path)
    text = hprs.envs.task_text_of(environment)
    if text is None:
        make_bare(environment).close()
        raise UsageError(
            f"'{environment}' has no task of its own. Give it one: --task FILE{TASK_SUFFIX}"
        )
    return parse_task(text, path=environment), text


def read_task(path: str) -> tuple[Task, str]:
    """A task file, parsed and as text.

    Raises:
        UsageError: There is no such file.
        SpecError: The task is wrong.
    """
    file = Path(path)
    if not file.exists():
        near = [other.name for other in file.parent.glob(f"*{TASK_SUFFIX}")]
        raise UsageError(f"there is no task file '{path}'.{did_you_mean(file.name, near)}")
    # Once: what is no file on disk, such as a pipe, cannot be read again.
    text = read_text(path)
    return parse_task(text, path=path), normalised(text)


def _import(module: str, environment: str) -> None:
    # Users keep environments beside their tasks, and an installed command does not look there.
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, "")
    if not all(part.isidentifier() for part in module.split(".")):
        raise UsageError(f"unknown environment '{environment}': '{module}' is not a module's name.")
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise UsageError(
            f"unknown environment '{environment}': there is no module '{error.name}'."
        ) from None


def require(package: str, extra: str) -> Any:
    """Import an optional package.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        return importlib.import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise MissingExtraError(package.replace("_", "-"), extra) from None
