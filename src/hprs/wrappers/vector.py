"""Puts a task on a `gymnasium.vector.VectorEnv`, in each of its three autoreset modes.

The task may end an episode that its sub-environment would go on with; the wrapper then resets that
sub-environment, so that a caller sees nothing but the wrapped environment's autoreset mode.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, cast

import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv, VectorWrapper

from hprs.errors import SignalError
from hprs.rewards.base import Reward
from hprs.rewards.shaping import End
from hprs.semantics import assessment
from hprs.semantics.evaluation import Evaluation, carry, evaluate_arrays
from hprs.semantics.plan import plan_of
from hprs.spec.task import ENV_REWARD, Task
from hprs.wrappers.announcement import announce_components, withdraw_components
from hprs.wrappers.arguments import (
    chosen_reward,
    require_environment,
    warn_of_changed_observations,
)
from hprs.wrappers.batch import BatchReader
from hprs.wrappers.merging import (
    copy_batch,
    masked,
    merge_infos,
    merge_rows,
    merge_tally,
    set_row,
    take_row,
    without_rows,
)
from hprs.wrappers.probing import undisturbed, undisturbed_rows
from hprs.wrappers.resets import Mask, forced_reset, reset_by_mask
from hprs.wrappers.signals import SignalFunction, make_reader, zero_action
from hprs.wrappers.single import nan_margin


def wrap_vector(
    envs: VectorEnv[Any, Any, Any],
    task: Task,
    reward: str | Reward = "hprs",
    *,
    end: End | None = None,
    discount: float | None = None,
    reward_options: Mapping[str, Any] | None = None,
    signals: SignalFunction | None = None,
    end_on_violation: bool = True,
    end_on_target: bool = True,
) -> TaskVectorWrapper:
    """Put a task on a vector environment; `info` entries and arguments as for `hprs.wrap`.

    The signal function gets batches. Entries of `info` are arrays with a mask `_key`, as Gymnasium
    has them; `assessment` is an array of objects. With same-step autoreset the last step's entries
    stand in `final_info`.

    Every sub-environment's episodes are those of `hprs.wrap`. One exception: an `AsyncVectorEnv` in
    autoreset mode NEXT_STEP steps a sub-environment whose episode the task has ended once more
    before it resets it. What `np_random` draws is undone, other hidden state that outlives a reset
    is not; use SAME_STEP or DISABLED where that matters.

    Raises:
        SignalError: A signal is missing or misshapen.
        UsageError: The reward or the convention is unknown, or the task would end episodes that
            this vector environment cannot end (see `forced_reset`).
    """
    require_environment(envs, vector=True)
    return TaskVectorWrapper(
        envs,
        task=task,
        reward=chosen_reward(
            reward, task, envs, end=end, discount=discount, options=reward_options
        ),
        signals=signals,
        end_on_violation=end_on_violation,
        end_on_target=end_on_target,
    )


class TaskVectorWrapper(VectorWrapper[Any, Any, Any, Any, Any]):
    """What `wrap_vector` returns."""

    def __init__(
        self,
        envs: VectorEnv[Any, Any, Any],
        *,
        task: Task,
        reward: Reward,
        signals: SignalFunction | None,
        end_on_violation: bool,
        end_on_target: bool,
    ) -> None:
        super().__init__(envs)
        self.task = task
        self.reward = reward
        bare: Any = envs.unwrapped
        parts = bare.envs if isinstance(bare, SyncVectorEnv) else ()
        warn_of_changed_observations(envs, *parts)
        self._plan = plan = plan_of(task)
        self._mode = AutoresetMode(envs.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP))
        reader = make_reader(task, envs.single_observation_space, envs.single_action_space, signals)
        self._signals = BatchReader(task, reader, envs.num_envs)
        self._reads_last_action = reader.reads_last_action
        self._end_on_violation = end_on_violation and plan.safety_count > 0
        self._end_on_target = end_on_target and plan.achieves
        self._force: Callable[[Mask], None] | None = None
        if self._mode != AutoresetMode.DISABLED and (self._end_on_violation or self._end_on_target):
            self._force = forced_reset(envs)
        zero = zero_action(envs.single_action_space)
        self._zeros: Any = None if zero is None else np.stack([zero] * self.num_envs)
        self._everyone: Mask = np.ones(self.num_envs, bool)
        self._ended: Mask = ~self._everyone
        self._forced: Mask = ~self._everyone
        self._memory: Any = None
        self._tally: Any = None
        self._reached: Mapping[str, Any] = {}
        self._current: Mapping[str, Any] = {}
        self._begun: tuple[Mask, dict[str, Any]] | None = None
        self._last_action: Any = None
        if reader.needs_probe:
            with undisturbed(envs):
                observation, infos = envs.reset()
            reader.at_reset(observation, self._zeros, infos)
            self._signals.at_reset(observation, self._zeros, infos, self._everyone)
        # Last: what could not be wrapped announces nothing.
        announce_components(self, reward)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset all sub-environments, or those of `options["reset_mask"]`."""
        mask = self._everyone
        if options is not None and "reset_mask" in options:
            mask = np.array(options["reset_mask"])
        observation, infos = self.env.reset(seed=cast(Any, seed), options=options)
        if self._tally is None and not mask.all():
            raise SignalError("the first reset must be of all sub-environments.")
        infos = self._begin(mask, observation, infos)
        self._ended = self._ended & ~mask
        self._forced = self._forced & ~mask
        return observation, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step all sub-environments; the rewards are the task's."""
        if self._tally is None:
            raise SignalError("step() was called before reset().")
        resetting = self._ended if self._mode == AutoresetMode.NEXT_STEP else ~self._everyone
        if self._forced.any() and self._mode == AutoresetMode.NEXT_STEP and self._resets_by_mask:
            # This step is one too many for these: their episodes have ended.
            with undisturbed_rows(self.env, self._forced):
                _, env_reward, terminated, truncated, infos = self.env.step(actions)
            observation, reset_infos = self._reset_rows(self._forced)
            infos = merge_infos(without_rows(infos, self._forced), reset_infos, self._forced)
        else:
            observation, env_reward, terminated, truncated, infos = self.env.step(actions)
        env_reward = np.array(env_reward, dtype=np.float64)
        own_end = terminated | truncated
        last_observation, last_infos = self._last(observation, infos, own_end)
        rewards, terminated, truncated, described = self._transition(
            actions, last_observation, last_infos, env_reward, terminated, truncated, resetting
        )
        done = terminated | truncated
        forced = done & ~own_end & ~resetting
        if self._mode == AutoresetMode.SAME_STEP:
            if done.any():
                observation, infos = self._restart(observation, infos, described, done, forced)
            infos = merge_infos(infos, described, ~done)
        else:
            infos = merge_infos(infos, described, ~resetting)
            if resetting.any():
                infos = self._begin(resetting, observation, infos)
            self._ended, self._forced = done, forced
            if self._force is not None and forced.any() and not self._resets_by_mask:
                self._force(forced)
        return observation, rewards, terminated, truncated, infos

    def close(self, **kwargs: Any) -> None:
        """Close all sub-environments."""
        withdraw_components(self)
        super().close(**kwargs)

    @property
    def reached_signal_values(self) -> Mapping[str, Any]:
        """Signal to its values in the states that the last step led to, (N,) or (N, length).

        Where an episode ended, in its final state. Rows that the step only reset hold anything.
        """
        return self._reached

    @property
    def signal_values(self) -> Mapping[str, Any]:
        """Signal to its values in the newest states: with same-step autoreset, in new episodes."""
        if self._begun is not None:
            # Merged only where somebody asks.
            mask, values = self._begun
            current, self._begun = self._current, None
            self._current = {
                name: merge_rows(mask, values[name], current[name]) for name in self._plan.signals
            }
        return self._current

    @property
    def _resets_by_mask(self) -> bool:
        return self._force is reset_by_mask

    def _transition(
        self,
        actions: Any,
        observation: Any,
        infos: dict[str, Any],
        env_reward: Any,
        terminated: Any,
        truncated: Any,
        resetting: Mask,
    ) -> tuple[Any, Any, Any, dict[str, Any]]:
        """Reward, ends and info entries of the transitions; rows of `resetting` are not any."""
        plan = self._plan
        partial = resetting.any()
        steps = self._tally.steps + 1
        values = self._signals.after_step(
            observation, actions, self._last_action, infos, ~resetting, steps
        )
        evaluation = self._evaluate(values, ~resetting, steps)
        tally = assessment.advance(plan, self._tally, evaluation.satisfied)
        if self._end_on_violation:
            terminated = terminated | ~assessment.is_safe(tally)
        if self._end_on_target:
            terminated = terminated | assessment.achieved(plan, tally)
        if partial:
            terminated = terminated & ~resetting
            truncated = truncated & ~resetting
        values[ENV_REWARD] = env_reward
        memory, rewards = self.reward.step(self._memory, values, terminated, truncated)
        rewards = np.asarray(rewards, dtype=np.float64)
        if partial:
            rewards = merge_rows(resetting, np.zeros_like(rewards), rewards)
        self._memory, self._tally = memory, tally
        self._reached, self._current, self._begun = values, values, None
        if self._reads_last_action:
            self._last_action = np.array(actions)
        described = self._describe(evaluation, ~resetting if partial else self._everyone)
        described["env_reward"] = env_reward
        described["_env_reward"] = ~resetting if partial else self._everyone
        done = terminated | truncated
        if done.any():
            described["assessment"], described["_assessment"] = self._conclude(done), done
        return rewards, terminated, truncated, described

    def _restart(
        self,
        observation: Any,
        infos: dict[str, Any],
        described: dict[str, Any],
        done: Mask,
        forced: Mask,
    ) -> tuple[Any, dict[str, Any]]:
        """Same-step autoreset: the last steps go to `final_*`, first states are returned."""
        final_obs = infos.get("final_obs", np.full(self.num_envs, None, dtype=object))
        final_info = infos.get("final_info", {})
        if forced.any():
            for row in np.flatnonzero(forced):
                final_obs[row] = take_row(observation, row)
            stepped = {k: v for k, v in infos.items() if k.lstrip("_") not in _FINAL}
            final_info = merge_infos(final_info, stepped, forced)
            infos = without_rows(infos, forced)
            observation, reset_infos = self._reset_rows(forced)
            infos = merge_infos(infos, reset_infos, forced)
        infos = {
            **infos,
            "final_obs": final_obs,
            "_final_obs": done,
            "final_info": merge_infos(final_info, described, done),
            "_final_info": done,
        }
        return observation, self._begin(done, observation, infos)

    def _begin(self, mask: Mask, observation: Any, infos: dict[str, Any]) -> dict[str, Any]:
        """Start new episodes in the rows of a mask, whose observation is s_0."""
        values = self._signals.at_reset(observation, self._zeros, infos, mask)
        evaluation = self._evaluate(values, mask, np.zeros(self.num_envs, int))
        memory = self.reward.init(values)
        tally = assessment.start(self._plan, evaluation.satisfied)
        if self._tally is None:
            # So that a memory that cannot be merged is refused now, not in the middle of a run.
            merge_rows(self._everyone, memory, memory)
        whole = self._tally is None or mask.all()
        self._memory = memory if whole else merge_rows(mask, memory, self._memory)
        self._tally = tally if whole else merge_tally(mask, tally, cast(Any, self._tally))
        if whole:
            self._current, self._begun = values, None
        else:
            self._current, self._begun = self.signal_values, (mask, values)
        if self._zeros is not None and self._reads_last_action:
            last = self._zeros if whole else merge_rows(mask, self._zeros, self._last_action)
            self._last_action = np.array(last)
        return merge_infos(infos, self._describe(evaluation, mask), mask)

    def _evaluate(self, values: dict[str, Any], mask: Mask, steps: Any) -> Evaluation:
        evaluation = evaluate_arrays(self._plan, values, np)
        invalid = np.isnan(evaluation.potential) & mask
        if invalid.any():
            row = int(np.flatnonzero(invalid)[0])
            margins = self._plan.by_label([margin[row] for margin in evaluation.margins])
            raise nan_margin(margins, f"{int(steps[row])} of sub-environment {row}")
        carry(values, self.task, evaluation)
        return evaluation

    def _describe(self, evaluation: Evaluation, mask: Mask) -> dict[str, Any]:
        plan = self._plan
        described: dict[str, Any] = {
            "margins": masked(plan.by_label(evaluation.margins), mask),
            "scores": masked(plan.by_label(evaluation.scores), mask),
            "potential": evaluation.potential,
            "cost": assessment.violations(plan, evaluation),
        }
        return masked(described, mask)

    def _conclude(self, done: Mask) -> Any:
        found = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(done):
            tally = assessment.Tally(
                [bool(held) for held in self._tally.safe[:, row]],
                bool(self._tally.target[row]),
                [int(count) for count in self._tally.counts[:, row]],
                int(self._tally.steps[row]),
                bool(self._tally.decided_at_start[row]),
            )
            found[row] = assessment.conclude(self._plan, tally, outside=self._signals.outside(row))
        return found

    def _last(self, observation: Any, infos: dict[str, Any], ended: Mask) -> tuple[Any, Any]:
        """The observation and infos of the states reached, before any same-step reset."""
        if self._mode != AutoresetMode.SAME_STEP or not ended.any():
            return observation, infos
        last = copy_batch(observation)
        for row in np.flatnonzero(ended):
            set_row(last, row, infos["final_obs"][row])
        stepped = {k: v for k, v in infos.items() if k.lstrip("_") not in _FINAL}
        return last, merge_infos(without_rows(stepped, ended), infos.get("final_info", {}), ended)

    def _reset_rows(self, mask: Mask) -> tuple[Any, dict[str, Any]]:
        return self.env.reset(options={"reset_mask": mask.copy()})


_FINAL = ("final_obs", "final_info")
