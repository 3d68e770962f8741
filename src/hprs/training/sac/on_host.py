"""SAC on environments that Python steps: acting and updating are compiled, stepping is not.

While an environment is stepped, the networks are updated: the update misses the newest transition,
and every action is chosen with the newest networks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from hprs.training.arrays import pack, unpack
from hprs.training.configuration import Configuration
from hprs.training.environment import make_configured
from hprs.training.evaluation import Episode, evaluate
from hprs.training.frames import frames_of
from hprs.training.host import HostEnvironments, Transition, make_host
from hprs.training.host.policy import PaddedPolicy
from hprs.training.learner_session import STATE
from hprs.training.sac.buffer import Buffer, empty, frame_of, sampled
from hprs.training.sac.learner import Batch, Member, Report, Weights
from hprs.training.sac.memory import require_room, transitions
from hprs.training.sac.sac_session import SacSession, holds_numbers, told
from hprs.training.sac.settings import Settings
from hprs.training.trees import bytes_of, pack_tree, unpack_tree
from hprs.wrappers.single import TaskWrapper

ARRAYS, COUNTS = "environments.npz", "counts.json"

CHUNK = 32
"""Rounds whose random numbers are drawn together, and after which a watcher hears of them."""


class Draws(NamedTuple):
    """All that is random in some rounds, (CHUNK, ...)."""

    noise: np.ndarray
    """Of actions, (T, N, m)."""
    anything: np.ndarray
    """Actions before learning starts, (T, N, m)."""
    bits: np.ndarray
    """That choose transitions, (G, B)."""
    update: np.ndarray
    """Noise of updates, (G, 2, B, m)."""


class HostSession(SacSession):
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
        super().__init__(configuration, environment)
        s = self.shape.settings
        self._weights = self.shape.weights(configuration.parameters, configuration.steps)
        self._environments = environments
        self._frames = frames_of(None, self.shape.observation)
        self.member: Member = self.shape.make(configuration.seed, configuration.parameters)
        remembered = transitions(s, self._frames, self.shape.actions.outputs)
        self.notice = require_room(remembered, bytes_of(self.member), 1)
        made = empty(
            s.buffer_size // s.environments,
            s.environments,
            self._frames,
            self.shape.actions.outputs,
            np,
        )
        self._buffer: Buffer = made
        self._act, self._best = jax.jit(self._acted), jax.jit(self.shape.best)
        self._update = jax.jit(self._updated, donate_argnums=0)
        self._draw = jax.jit(self._drawn)
        self._check = jax.jit(holds_numbers)
        self._report: Report | None = None
        self._rounds, self._step, self._count = 0, 0, 0
        self._draws: tuple[int, Draws] | None = None
        self._batches: list[Batch] = []
        environments.reset(configuration.seed)

    @property
    def step(self) -> int:
        """Environment steps so far; those that only reset an environment do not count."""
        return self._step

    def learned(self, member: int) -> Member:
        """What has been learned so far."""
        return self.member

    def is_finite(self, member: int) -> bool:
        """Whether its networks hold numbers."""
        return bool(self._check(self.member))

    def scalars(self, member: int) -> Mapping[str, float]:
        """What is told of the newest update."""
        return {} if self._report is None else told(self._report)

    def restore(self, member: int, contents: Mapping[str, bytes]) -> list[str]:
        """Go on from a capture; episodes that cannot go on begin anew."""
        self.member = unpack_tree(contents[STATE], self.member)
        kept = json.loads(contents[COUNTS])
        self._step, self._rounds = kept["step"], kept["rounds"]
        self._count = self._rounds * self.shape.settings.train_freq
        self._batches = []
        return self._environments.restore({**kept["environments"], **unpack(contents[ARRAYS])})

    def capture(self, member: int) -> dict[str, bytes]:
        """The whole state but for the transitions."""
        state = self._environments.state()
        arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
        kept = {
            "step": self._step,
            "rounds": self._rounds,
            "environments": {name: state[name] for name in state if name not in arrays},
        }
        return {
            STATE: pack_tree(self.member),
            COUNTS: json.dumps(kept).encode(),
            ARRAYS: pack(arrays),
        }

    def ring(self, member: int) -> HostRing:
        """Its transitions."""
        return HostRing(self._buffer, self._count)

    def advance(self, until: int) -> None:
        """Rounds to the end of a chunk, or until a step is reached."""
        self._play_round()
        while self._rounds % CHUNK and self._step < until:
            self._play_round()

    def _play_round(self) -> None:
        """Steps of all environments, and updates beside the last of them."""
        s, draws, number = self.shape.settings, self._drawn_for(self._rounds), self._rounds % CHUNK
        for time in range(s.train_freq):
            action, given = self._chosen(draws.noise[number, time], draws.anything[number, time])
            early = s.overlap and time == s.train_freq - 1
            if early:
                # It was drawn while the last update went on; the transition to come is not in it.
                self._learn(self._batches or self._sampled(self._rounds), draws.update[number])
            seen = self._environments.seen.observation
            made = self._environments.step(given)
            self._remember(seen, action, made)
            self._step += int(made.valid.sum())
        if not s.overlap:
            self._learn(self._sampled(self._rounds), draws.update[number])
        self._rounds += 1
        self._batches = self._sampled(self._rounds) if s.overlap else []

    def _sampled(self, rounds: int) -> list[Batch]:
        """The batches of a round, of all that is remembered now; none before learning starts."""
        s = self.shape.settings
        if self._count * s.environments <= s.learning_starts:
            return []
        bits = self._drawn_for(rounds).bits[rounds % CHUNK]
        found = [sampled(self._buffer, self._frames, b[None], self._count, 1, np) for b in bits]
        return [Batch(*(column[0] for column in batch)) for batch in found]

    def _learn(self, batches: Sequence[Batch], noise: np.ndarray) -> None:
        """Begin the updates of a round; the device works while this goes on."""
        for batch, of_it in zip(batches, noise, strict=False):
            self.member, self._report = self._update(
                self.member, batch, of_it, self._weights, np.float32(self._step)
            )

    def _chosen(self, noise: np.ndarray, anything: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Actions in [-1, 1], and as the environments take them."""
        if self._step < self.shape.settings.learning_starts:
            return anything, np.asarray(self.shape.actions.for_environment(jnp.asarray(anything)))
        return jax.device_get(self._act(self.member, self._environments.seen.observation, noise))

    def _drawn_for(self, rounds: int) -> Draws:
        """The random numbers of a round's chunk; they depend on the seed and on nothing else."""
        chunk = rounds // CHUNK
        if self._draws is None or self._draws[0] != chunk:
            found = self._draw(self.member.key, chunk)
            self._draws = chunk, Draws(*map(np.asarray, found))
        return self._draws[1]

    def _remember(self, observation: np.ndarray, action: np.ndarray, made: Transition) -> None:
        at = self._count % len(self._buffer.reward)
        row = Buffer(
            frame=frame_of(observation, self._frames),
            reached=frame_of(made.reached.observation, self._frames),
            action=action,
            reward=made.reward,
            terminated=made.terminated,
            truncated=made.truncated,
            valid=made.valid,
            age=np.zeros(len(made.reward), np.uint8),
        )
        for all_, one in zip(self._buffer, row, strict=True):
            all_[at] = one
        self._count += 1

    def evaluate(self, seeds: Sequence[int], watch: Any) -> list[list[Episode]]:
        """Run the policy on one episode a seed, some at a time."""
        policy = PaddedPolicy(partial(self._best, self.member))
        return [evaluate(lambda: make_configured(self._configuration), policy, seeds, watch)]

    def close(self) -> None:
        """Close the environments."""
        self._environments.close()

    def _acted(self, member: Member, observation: Array, noise: Array) -> tuple[Array, Array]:
        action = self.shape.act(member, observation, noise)
        return action, self.shape.actions.for_environment(action)

    def _updated(
        self, member: Member, batch: Batch, noise: Array, weights: Weights, made: Array
    ) -> tuple[Member, Report]:
        return self.shape.update(member, batch, noise, weights, made)

    def _drawn(self, key: Array, chunk: Array) -> tuple[Array, Array, Array, Array]:
        s, outputs = self.shape.settings, self.shape.actions.outputs
        keys = jax.random.split(jax.random.fold_in(jax.random.wrap_key_data(key), chunk), 4)
        steps = CHUNK, s.train_freq, s.environments, outputs
        updates = CHUNK, s.gradient_steps
        return (
            jax.random.normal(keys[0], steps),
            jax.random.uniform(keys[1], steps, minval=-1.0, maxval=1.0),
            jax.random.bits(keys[2], (*updates, s.batch_size), jnp.uint32),
            jax.random.normal(keys[3], (*updates, 2, s.batch_size, outputs)),
        )


class HostRing:
    """The transitions of a training, as they are kept on disk.

    Args:
        buffer: The transitions, arrays of NumPy.
        rows: Steps of all environments since the training began.
    """

    def __init__(self, buffer: Buffer, rows: int) -> None:
        self._arrays: dict[str, Any] = buffer._asdict()
        self.rows = rows
        """Rows that it was given since the training began."""
        self.capacity = len(buffer.reward)
        """Rows that it holds at most."""

    @property
    def row_bytes(self) -> int:
        """Memory of a row."""
        return sum(array[0].nbytes for array in self._arrays.values())

    def read(self, places: np.ndarray) -> dict[str, np.ndarray]:
        """Some rows, by their places."""
        return {name: array[places] for name, array in self._arrays.items()}

    def write(self, places: np.ndarray, rows: Mapping[str, np.ndarray]) -> None:
        """Put rows at their places."""
        for name, array in self._arrays.items():
            array[places] = rows[name]


def open_host(configuration: Configuration, environment: TaskWrapper) -> HostSession:
    """A session that steps environments of its own."""
    settings = Settings.of(configuration.parameters)
    environments = make_host(configuration, settings.environments, vectorized=False)
    return HostSession(configuration, environment, environments)
