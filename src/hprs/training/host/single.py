"""Steps environments one after the other in this process; their episodes can be brought back."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from hprs.semantics.plan import plan_of
from hprs.spec.task import Task
from hprs.training.episode_log import EpisodeState
from hprs.training.host.episodes import EpisodeLogs
from hprs.training.host.interface import Seen, Transition
from hprs.training.random_states import training_seed
from hprs.wrappers.single import TaskWrapper

Pick = Callable[[Mapping[str, Any]], Sequence[float]]


class SingleEnvironments:
    """Environments with the same task, reset in the step that ends an episode.

    Args:
        environments: At least one.
    """

    def __init__(self, environments: Sequence[TaskWrapper]) -> None:
        self._environments = tuple(environments)
        first = environments[0]
        self.number = len(environments)
        self.observation_space = first.observation_space
        self.action_space = first.action_space
        shape = first.observation_space.shape or ()
        self._shape = (self.number, *shape)
        self._logs = EpisodeLogs(environments, math.prod(shape))
        self._pick = _picker(first.task)
        self._seed, self._steps = 0, 0
        self._seen: Seen | None = None

    @property
    def seen(self) -> Seen:
        """What the next actions are chosen from."""
        assert self._seen is not None, "reset() comes first"  # noqa: S101
        return self._seen

    def reset(self, seed: int) -> Seen:
        """New episodes everywhere; the seeds of the environments are derived from one."""
        self._seed, self._steps = seed, 0
        rows = range(self.number)
        return self._look([self._logs.reset(row, training_seed(seed, 0, row)) for row in rows])

    def step(self, actions: np.ndarray) -> Transition:
        """Step all environments."""
        observations = np.empty(self._shape, np.float32)
        terminated, truncated = np.zeros((2, self.number), bool)
        rewards: list[Any] = []
        # One list of all signals becomes an array faster than each row is written to one.
        signals: list[float] = []
        ended: list[int] = []
        pick = self._pick
        for row, (environment, action) in enumerate(zip(self._environments, actions, strict=True)):
            observation, reward, terminates, truncates, _ = environment.step(action)
            observations[row] = observation
            signals += pick(environment.signal_values)
            rewards.append(reward)
            if terminates or truncates:
                terminated[row], truncated[row] = terminates, truncates
                ended.append(row)
        self._steps += 1
        reached = self._arranged(observations, signals)
        paid = np.array(rewards, np.float64)
        self._logs.add(actions, reached.observation, paid)
        self._seen = self._renewed(reached, ended) if ended else reached
        return Transition(
            reward=paid.astype(np.float32),
            terminated=terminated,
            truncated=truncated,
            valid=np.ones(self.number, bool),
            reached=reached,
            next=self._seen,
        )

    def state(self) -> dict[str, Any]:
        """What `restore` needs: name to a NumPy array or a JSON value."""
        episodes = self._logs.states()
        actions = {f"actions {row}": episode.actions for row, episode in enumerate(episodes)}
        return {
            "seed": self._seed,
            "steps": self._steps,
            "episodes": [episode.to_json() for episode in episodes],
            **actions,
        }

    def restore(self, state: Mapping[str, Any]) -> list[str]:
        """Go back to where `state` was taken, by doing the running episodes' actions again.

        Returns:
            For every environment that had to begin a new episode the reason.
        """
        self._seed, self._steps = state["seed"], state["steps"]
        kept = [
            EpisodeState(actions=state[f"actions {row}"], **episode)
            for row, episode in enumerate(state["episodes"])
        ]
        seeds = [training_seed(self._seed, self._steps, row) for row in range(self.number)]
        observations, reasons = self._logs.replay(kept, seeds)
        self._look(observations)
        return [reason for reason in reasons if reason]

    def close(self) -> None:
        """Close all environments."""
        for environment in self._environments:
            environment.close()

    def _look(self, newest: Sequence[Any]) -> Seen:
        """What is seen of all environments, from their newest observations."""
        observations = np.empty(self._shape, np.float32)
        signals: list[float] = []
        for row, environment in enumerate(self._environments):
            observations[row] = newest[row]
            signals += self._pick(environment.signal_values)
        self._seen = self._arranged(observations, signals)
        return self._seen

    def _renewed(self, reached: Seen, ended: Sequence[int]) -> Seen:
        """What is seen after some environments are reset."""
        following = Seen(*(array.copy() for array in reached))
        for row in ended:
            following.observation[row] = np.ravel(self._logs.reset(row))
            following.signals[row] = self._pick(self._environments[row].signal_values)
        return following

    def _arranged(self, observations: np.ndarray, signals: list[float]) -> Seen:
        raw = np.array(signals, np.float32)
        size = raw.size // self.number
        return Seen(observations.reshape(self.number, -1), raw.reshape(self.number, size))


def _picker(task: Task) -> Pick:
    """Picks a task's signals out of their dictionary as numbers side by side."""
    names = plan_of(task).signals
    vectors = {signal.name for signal in task.signals if signal.length is not None}
    if len(names) > 1 and vectors.isdisjoint(names):
        return itemgetter(*names)

    def pick(values: Mapping[str, Any]) -> list[float]:
        picked: list[float] = []
        for name in names:
            if name in vectors:
                picked += values[name].tolist()
            else:
                picked.append(values[name])
        return picked

    return pick
