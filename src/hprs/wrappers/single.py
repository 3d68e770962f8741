"""Puts a task on a `gymnasium.Env`: its reward, its episode ends, and its assessment."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, SupportsFloat

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs

from hprs.errors import SignalError
from hprs.rewards.base import Reward
from hprs.rewards.shaping import End
from hprs.semantics.assessment import violations
from hprs.semantics.evaluation import carry
from hprs.semantics.plan import plan_of
from hprs.semantics.single_state import float_evaluator
from hprs.spec.task import ENV_REWARD, Task, require_task
from hprs.wrappers.announcement import announce_components, withdraw_components
from hprs.wrappers.arguments import (
    chosen_reward,
    require_environment,
    warn_of_changed_observations,
)
from hprs.wrappers.episode import Episode
from hprs.wrappers.signals import SignalFunction, make_reader, zero_action
from hprs.wrappers.state import StateReader


def wrap(
    env: gym.Env[Any, Any],
    task: Task,
    reward: str | Reward = "hprs",
    *,
    end: End | None = None,
    discount: float | None = None,
    reward_options: Mapping[str, Any] | None = None,
    signals: SignalFunction | None = None,
    end_on_violation: bool = True,
    end_on_target: bool = True,
) -> TaskWrapper:
    """Put a task on an environment.

    The wrapper replaces the reward, ends the episode where the task decides it, and adds to `info`:
    `margins`, `scores` (label to value), `potential`, `env_reward` (the original one),
    `cost` (number of violated safety requirements), and in an episode's last step `assessment`.

    Wrap before normalisation and stacking: signals read raw observations. Where the task reads
    `info` or `signals` is given, the environment is reset once, to see that every signal exists.
    A signal with `initially` may be absent then: whether its `info` entry exists, a misspelt name
    included, only the first step tells.

    Args:
        env: The environment.
        task: The task.
        reward: A name of `hprs.rewards.REWARDS`, or a reward. One that pays several numbers, as
            `"vector"`, gives the environment a `reward_space`, as MO-Gymnasium has it, until it is
            closed. What a reward asks of the learner (`hprs.rewards.demands_of(env.reward)`: a
            discount, the horizon as terminal) only `hprs train` applies; with another learner,
            apply it yourself.
        end: End-of-episode convention of the shaping, `"paper"` unless given; see
            `hprs.rewards.shaping`. Only for rewards given by name.
        discount: The learner's discount; `end="invariant"` needs it. Only for rewards given by
            name.
        reward_options: The reward's own options, as docs/rewards.md lists them. Only for rewards
            given by name.
        signals: A function `(observation, action, last_action, info) -> {signal: value}` that
            supplies some or all signals.
        end_on_violation: End the episode (terminated) when a safety requirement is violated.
        end_on_target: End the episode (terminated) when an `achieve` target is met. A `conquer`
            target is decided at the horizon.

    Raises:
        SignalError: A signal is missing or misshapen.
        UsageError: The reward or the convention is unknown, or an argument is of the wrong kind.
    """
    require_environment(env, vector=False)
    return TaskWrapper(
        env,
        task=task,
        reward=chosen_reward(reward, task, env, end=end, discount=discount, options=reward_options),
        signals=signals,
        end_on_violation=end_on_violation,
        end_on_target=end_on_target,
    )


class TaskWrapper(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """What `wrap` returns; `gymnasium.make(env.spec)` makes another of it."""

    def __init__(
        self,
        env: gym.Env[Any, Any],
        *,
        task: Task,
        reward: Reward,
        signals: SignalFunction | None,
        end_on_violation: bool,
        end_on_target: bool,
    ) -> None:
        # Not copied: tasks and rewards are frozen, and a function's belongings may not be copyable.
        RecordConstructorArgs.__init__(
            self,
            _disable_deepcopy=True,
            task=task,
            reward=reward,
            signals=signals,
            end_on_violation=end_on_violation,
            end_on_target=end_on_target,
        )
        gym.Wrapper.__init__(self, env)  # pyright: ignore[reportUnknownMemberType]
        self.task = require_task(task)
        self.reward = reward
        warn_of_changed_observations(env)
        self._plan = plan = plan_of(task)
        reader = make_reader(task, env.observation_space, env.action_space, signals)
        self._signals = StateReader(task, reader)
        self._evaluate = float_evaluator(plan)
        self._reads_last_action = reader.reads_last_action
        self._zero_action = zero_action(env.action_space)
        self._episode = Episode(
            plan, end_on_violation=end_on_violation, end_on_target=end_on_target
        )
        self._memory: Any = None
        self._last_action: Any = self._zero_action
        self.signal_values: Mapping[str, Any] = {}
        """Signal to its value in the newest state, a float or a vector; of those that the task
        uses, beside what a reward finds there."""
        if reader.needs_probe:
            self._probe()
        # Last: what could not be wrapped announces nothing.
        announce_components(self, reward)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset the environment, and start a new assessment."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._last_action = deepcopy(self._zero_action)
        values = self.signal_values = self._signals.at_reset(observation, self._zero_action, info)
        evaluation = self._evaluate(values)
        if evaluation.potential != evaluation.potential:
            raise nan_margin(evaluation.margins, 0)
        self._episode.start(evaluation.satisfied)
        carry(values, self.task, evaluation)
        self._memory = self.reward.init(values)
        info = dict(info)
        info["margins"], _, info["scores"], info["potential"] = evaluation
        info["cost"] = violations(self._plan, evaluation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Step the environment; the reward is the task's."""
        episode = self._episode
        step = episode.steps + 1
        if step == 0:
            raise SignalError("step() was called before reset().")
        observation, env_reward, terminated, truncated, info = self.env.step(action)
        env_reward = float(env_reward)
        terminated, truncated = bool(terminated), bool(truncated)
        values = self._signals.after_step(observation, action, self._last_action, info, step)
        evaluation = margins, satisfied, scores, potential = self._evaluate(values)
        if potential != potential:
            raise nan_margin(margins, step)
        if episode.add(satisfied):
            terminated = True
        if self._reads_last_action:
            self._last_action = np.array(action)
        values[ENV_REWARD] = env_reward
        carry(values, self.task, evaluation)
        self._memory, reward = self.reward.step(self._memory, values, terminated, truncated)
        self.signal_values = values
        info = dict(info)
        info["margins"], info["scores"], info["potential"] = margins, scores, potential
        info["cost"] = violations(self._plan, evaluation)
        info["env_reward"] = env_reward
        if terminated or truncated:
            info["assessment"] = episode.conclude(self._signals.outside)
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Close the environment."""
        withdraw_components(self)
        super().close()

    def _probe(self) -> None:
        """Reset once, without disturbing the environment's generator."""
        bare = self.env.unwrapped
        generator = deepcopy(bare.__dict__.get("_np_random"))
        try:
            observation, info = self.env.reset()
            self._signals.at_reset(observation, self._zero_action, info)
        finally:
            bare.__dict__["_np_random"] = generator


def nan_margin(margins: dict[str, Any], step: Any) -> SignalError:
    """The error of a margin that is NaN although no signal is."""
    label = next((name for name, value in margins.items() if np.isnan(value).any()), "?")
    return SignalError(
        f"the margin of requirement '{label}' is NaN at step {step}: a signal has left the range "
        "in which its expression is defined."
    )
