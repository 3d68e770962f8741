"""Rollouts of environments that Python steps: acting and updating are compiled, stepping is not."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.training.arrays import pack, unpack
from hprs.training.configuration import Configuration
from hprs.training.environment import make_configured
from hprs.training.evaluation import Episode, evaluate
from hprs.training.host import HostEnvironments, Transition, make_host
from hprs.training.host.policy import PaddedPolicy
from hprs.training.learner_session import STATE, told
from hprs.training.ppo.learner import Member, Rollout, Shape
from hprs.training.ppo.ppo_session import PpoSession, holds_numbers
from hprs.training.ppo.settings import Settings
from hprs.training.signal_scale import SignalScale, signal_scale
from hprs.training.trees import pack_tree, unpack_tree
from hprs.wrappers.single import TaskWrapper

ARRAYS, COUNTS = "environments.npz", "counts.json"


class Record:
    """A rollout as it is being made, in arrays of NumPy that are written over by the next one.

    Args:
        shape: What is common to all members.
        action: What one action looks like, as the learner draws it.
    """

    def __init__(self, shape: Shape, action: np.ndarray) -> None:
        times = shape.settings.n_steps, shape.settings.environments
        seen, signals = (*times, shape.observation), (*times, shape.signals)

        def room(shape: tuple[int, ...], kind: Any) -> Any:
            return np.zeros(shape, kind)

        self.rows = Rollout(
            observation=room(seen, np.float32),
            signals=room(signals, np.float32),
            action=room((*times, *action.shape[1:]), action.dtype),
            log_prob=room(times, np.float32),
            reward=room(times, np.float32),
            terminated=room(times, bool),
            truncated=room(times, bool),
            valid=room(times, bool),
            reached=room(seen, np.float32),
            reached_signals=room(signals, np.float32),
        )

    def add(
        self, time: int, before: Any, action: np.ndarray, log_prob: np.ndarray, made: Transition
    ) -> None:
        """Write down one step."""
        rows = self.rows
        rows.observation[time], rows.signals[time] = before
        rows.action[time], rows.log_prob[time] = action, log_prob
        rows.reward[time], rows.valid[time] = made.reward, made.valid
        rows.terminated[time], rows.truncated[time] = made.terminated, made.truncated
        rows.reached[time], rows.reached_signals[time] = made.reached


class HostSession(PpoSession):
    """A training whose environments Python steps; it has one member.

    Args:
        configuration: What to train.
        environment: A wrapped environment, for its spaces.
        environments: Those that are stepped.
    """

    def __init__(
        self,
        configuration: Configuration,
        environment: TaskWrapper,
        environments: HostEnvironments,
    ) -> None:
        self._scale: SignalScale = signal_scale(configuration.task)
        super().__init__(configuration, environment, self._scale)
        self._weights = self.shape.weights(configuration.parameters, configuration.steps)
        self._scalars: dict[str, float] = {}
        self._environments = environments
        self.member: Member = self.shape.make(configuration.seed)
        self._act = jax.jit(self._drawn)
        self._draw_noise = jax.jit(self._drawn_noise, static_argnums=(1, 2))
        self._best = jax.jit(self.shape.best)
        self._update = jax.jit(self._updated, donate_argnums=0)
        self._check = jax.jit(holds_numbers)
        self._step = 0
        seen = environments.reset(configuration.seed)
        action, _, _ = self._act(self.member, seen.observation, self._noise()[0])
        self._record = Record(self.shape, np.asarray(action))

    @property
    def step(self) -> int:
        """Environment steps so far; those that only reset an environment do not count."""
        return self._step

    def learned(self, member: int) -> Member:
        """What has been learned so far."""
        return self.member

    def is_finite(self, member: int) -> bool:
        """Whether its networks and statistics hold numbers."""
        return bool(self._check(self.member))

    def scalars(self, member: int) -> Mapping[str, float]:
        """What is told of the newest update."""
        return self._scalars

    def restore(self, member: int, contents: Mapping[str, bytes]) -> list[str]:
        """Go on from a capture; episodes that cannot go on begin anew."""
        self.member = unpack_tree(contents[STATE], self.member)
        kept = json.loads(contents[COUNTS])
        self._step = kept["step"]
        reasons = self._environments.restore({**kept["environments"], **unpack(contents[ARRAYS])})
        if reasons:
            # Which episodes have begun anew is not known: their returns would go on.
            nothing = jnp.zeros_like(self.member.discounted)
            self.member = self.member._replace(discounted=nothing)
        return reasons

    def capture(self, member: int) -> dict[str, bytes]:
        """The whole state."""
        state = self._environments.state()
        arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
        kept = {
            "step": self._step,
            "environments": {name: state[name] for name in state if name not in arrays},
        }
        return {
            STATE: pack_tree(self.member),
            COUNTS: json.dumps(kept).encode(),
            ARRAYS: pack(arrays),
        }

    def advance(self, until: int) -> None:
        """One rollout and its update: progress is told after each."""
        member, environments, noise = self.member, self._environments, self._noise()
        for time in range(self.shape.settings.n_steps):
            seen = environments.seen
            action, log_prob, given = jax.device_get(
                self._act(member, seen.observation, noise[time])
            )
            made = environments.step(given)
            self._record.add(time, seen, action, log_prob, made)
        rows, made = self._record.rows, self._step
        self._step += int(rows.valid.sum())
        self.member, scalars = self._update(self.member, rows, jnp.float32(made))
        self._scalars = told(scalars)

    def evaluate(self, seeds: Sequence[int], watch: Callable[[int], None]) -> list[list[Episode]]:
        """Run the policy on one episode a seed, some at a time."""
        policy = PaddedPolicy(partial(self._best, self.member))
        return [evaluate(lambda: make_configured(self._configuration), policy, seeds, watch)]

    def close(self) -> None:
        """Close the environments."""
        self._environments.close()

    def _noise(self) -> np.ndarray:
        """What a rollout's actions are drawn with; the same whenever this update is made."""
        s = self.shape.settings
        return np.asarray(self._draw_noise(self.member.key, s.n_steps, s.environments))

    def _drawn_noise(self, data: Array, steps: int, number: int) -> Array:
        # The update splits the key in two, which are what 0 and 1 would give.
        key = jax.random.fold_in(jax.random.wrap_key_data(data), 2)
        return self.shape.actions.noise(key, (steps, number))

    def _drawn(self, member: Member, observation: Array, noise: Array) -> tuple[Any, Any, Any]:
        action, log_prob = self.shape.act(member, observation, noise)
        return action, log_prob, self.shape.actions.for_environment(action)

    def _updated(
        self, member: Member, rows: Rollout, made: Array
    ) -> tuple[Member, dict[str, Array]]:
        rows = rows._replace(
            signals=self._scale(rows.signals), reached_signals=self._scale(rows.reached_signals)
        )
        return self.shape.update(member, rows, self._weights, made)


def open_host(configuration: Configuration, environment: TaskWrapper) -> HostSession:
    """A session that steps environments of its own."""
    settings = Settings.of(configuration.parameters)
    environments = make_host(configuration, settings.environments, vectorized=settings.vectorized)
    return HostSession(configuration, environment, environments)
