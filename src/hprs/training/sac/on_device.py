"""SAC on environments that are JAX functions: stepping and learning are one compiled program."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from gymnasium.utils.seeding import np_random
from jax import Array

from hprs.envs.simulated import Simulation, draw_key
from hprs.training.configuration import Configuration
from hprs.training.device import DeviceEnvironment, Running, Step, Traces, episodes_of, trace
from hprs.training.evaluation import Episode
from hprs.training.frames import Frames, frames_of
from hprs.training.learner_session import STATE
from hprs.training.sac.buffer import Buffer, added, empty, frame_of, sampled
from hprs.training.sac.learner import Member, Report, Shape, Weights
from hprs.training.sac.memory import require_room, transitions
from hprs.training.sac.sac_session import SacSession, holds_numbers, told
from hprs.training.several import reward_of
from hprs.training.simulations import device_environment
from hprs.training.trees import bytes_of, one_of, pack_tree, unpack_tree
from hprs.wrappers.single import TaskWrapper

_BEGINNING = 2**32 - 1
"""What the key of the first episodes is folded with: no number of rounds."""

CHUNK = 32
"""Rounds whose random numbers are drawn together: inside a loop XLA would draw them anew."""


UPDATES_A_CALL = 1024
"""Updates of all members in a compiled call: whoever watches hears of the progress after each."""


class State(NamedTuple):
    """A population with its running episodes and what it remembers."""

    members: Member
    """Leaves (M, ...)."""
    running: Running
    """The members' environments one after the other, leaves (M * N, ...)."""
    buffer: Buffer
    rounds: Array
    """Made so far, () int32."""


class Part(NamedTuple):
    """What of a state belongs to one member, but for its transitions."""

    members: Member
    running: Running
    rounds: Array


class Draws(NamedTuple):
    """All that is random in a round, of every member, (M, ...)."""

    noise: Array
    """Of actions, (M, T, N, m)."""
    anything: Array
    """Actions before learning starts, (M, T, N, m)."""
    resets: Array
    """Data of keys of new episodes, (M, T, N, 2)."""
    bits: Array
    """That choose transitions, (M, G, B)."""
    update: Array
    """Noise of updates, (M, G, 2, B, m)."""


def draw(shape: Shape, key: Array, rounds: Array) -> Draws:
    """The random numbers of a member's next `CHUNK` rounds, (CHUNK, ...)."""
    s, outputs = shape.settings, shape.actions.outputs
    keys = jax.random.split(jax.random.fold_in(jax.random.wrap_key_data(key), rounds), 5)
    steps = CHUNK, s.train_freq, s.environments
    updates = CHUNK, s.gradient_steps
    return Draws(
        noise=jax.random.normal(keys[0], (*steps, outputs)),
        anything=jax.random.uniform(keys[1], (*steps, outputs), minval=-1.0, maxval=1.0),
        resets=jax.random.bits(keys[2], (*steps, 2), jnp.uint32),
        bits=jax.random.bits(keys[3], (*updates, s.batch_size), jnp.uint32),
        update=jax.random.normal(keys[4], (*updates, 2, s.batch_size, outputs)),
    )


def begin(
    shape: Shape,
    environment: DeviceEnvironment,
    frames: Frames,
    simulation: Simulation,
    members: Member,
) -> State:
    """A population that has learned nothing, in its first episodes.

    Args:
        shape: What is common to all members.
        environment: Task and rewards.
        frames: Of observations.
        simulation: What is simulated.
        members: Leaves (M, ...).
    """
    number = len(members.key)

    def keys(key: Array) -> Array:
        first = jax.random.fold_in(jax.random.wrap_key_data(key), _BEGINNING)
        return jax.random.bits(first, (shape.settings.environments, 2), jnp.uint32)

    rows = number * shape.settings.environments
    running = environment.reset(simulation, jax.vmap(keys)(members.key).reshape(rows, 2))
    capacity = shape.settings.buffer_size // shape.settings.environments
    buffer = empty(capacity, rows, frames, shape.actions.outputs)
    return State(members, running, buffer, jnp.zeros((), jnp.int32))


def train(
    shape: Shape,
    environment: DeviceEnvironment,
    frames: Frames,
    simulation: Simulation,
    state: State,
    weights: Weights,
    chunks: Array,
) -> tuple[State, Report]:
    """Some chunks of rounds; the report is that of the last update.

    Args:
        shape: What is common to all members.
        environment: Task and rewards.
        frames: Of observations.
        simulation: What is simulated.
        state: Where the training stands.
        weights: Hyper-parameters of each member, (M,).
        chunks: How many, (), at least 1.
    """
    last = state.rounds + chunks * CHUNK
    one_round = partial(play_round, shape, environment, frames, simulation, weights)

    def chunk(carry: tuple[State, Report]) -> tuple[State, Report]:
        state, report = carry
        draws = jax.vmap(partial(draw, shape), (0, None))(state.members.key, state.rounds)
        draws = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), draws)
        (state, report), _ = jax.lax.scan(
            lambda carry, drawn: (one_round(*carry, drawn), None), (state, report), draws
        )
        return state, report

    silence = Report(*[jnp.zeros(len(state.members.key))] * len(Report._fields))
    return jax.lax.while_loop(lambda carry: carry[0].rounds < last, chunk, (state, silence))


def play_round(
    shape: Shape,
    environment: DeviceEnvironment,
    frames: Frames,
    simulation: Simulation,
    weights: Weights,
    state: State,
    report: Report,
    draws: Draws,
) -> tuple[State, Report]:
    """Steps of all environments, and then updates of all members."""
    s, number = shape.settings, len(state.members.key)

    def step(
        carry: tuple[Running, Buffer, Array], drawn: tuple[Array, Array, Array]
    ) -> tuple[tuple[Running, Buffer, Array], None]:
        running, buffer, count = carry
        noise, anything, resets = drawn
        observation = running.observation.reshape(number, s.environments, -1)
        action = of_members(shape.act)(state.members, observation, noise)
        action = jnp.where(count * s.environments < s.learning_starts, anything, action)
        action = action.reshape(number * s.environments, -1)
        reached, made = environment.step(simulation, running, shape.actions.for_environment(action))
        buffer = added(buffer, _row(running, action, made, frames), count)
        running = _renewed(environment, simulation, reached, made, resets.reshape(-1, 2))
        return (running, buffer, count + 1), None

    stepping = jax.tree.map(
        lambda x: jnp.moveaxis(x, 1, 0), (draws.noise, draws.anything, draws.resets)
    )
    count = state.rounds * s.train_freq
    (running, buffer, count), _ = jax.lax.scan(step, (state.running, state.buffer, count), stepping)
    made = count * s.environments

    def update(
        carry: tuple[Member, Report], drawn: tuple[Array, Array]
    ) -> tuple[tuple[Member, Report], None]:
        members, _ = carry
        bits, noise = drawn
        batch = sampled(buffer, frames, bits, count, number)
        steps = jnp.broadcast_to(made.astype(float), (number,))
        return of_members(shape.update)(members, batch, noise, weights, steps), None

    def updates() -> tuple[Member, Report]:
        drawn = jax.tree.map(lambda x: jnp.moveaxis(x, 1, 0), (draws.bits, draws.update))
        return jax.lax.scan(update, (state.members, report), drawn)[0]

    members, report = jax.lax.cond(
        made > s.learning_starts, updates, lambda: (state.members, report)
    )
    return State(members, running, buffer, state.rounds + 1), report


def of_members(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of one member as one of all of them, on the first axis of its arguments.

    One alone is computed without the axis; several one after the other on a CPU, whose cores share
    the work inside of a matrix product, and at once elsewhere.
    """

    def of_all(*arguments: Any) -> Any:
        number = len(jax.tree.leaves(arguments[0])[0])
        if number == 1:
            alone = jax.tree.map(lambda leaf: leaf[0], arguments)
            return jax.tree.map(lambda leaf: leaf[None], function(*alone))
        if jax.default_backend() == "cpu":
            return jax.lax.map(lambda one: function(*one), arguments)
        return jax.vmap(function)(*arguments)

    return of_all


def _row(running: Running, action: Array, made: Step, frames: Frames) -> Buffer:
    return Buffer(
        frame=frame_of(running.observation, frames),
        reached=frame_of(made.observation, frames),
        action=action,
        reward=made.reward,
        terminated=made.terminated,
        truncated=made.truncated,
        valid=jnp.ones_like(made.terminated),
        age=jnp.minimum(running.length, frames.depth).astype(jnp.uint8),
    )


def _renewed(
    environment: DeviceEnvironment,
    simulation: Simulation,
    reached: Running,
    made: Step,
    resets: Array,
) -> Running:
    """The running episodes with new ones where they have ended."""
    ended = made.terminated | made.truncated

    def replaced(old: Array, new: Array) -> Array:
        return jnp.where(ended.reshape(-1, *(1,) * (old.ndim - 1)), new, old)

    def renew() -> Running:
        return jax.tree.map(replaced, reached, environment.reset(simulation, resets))

    # Most steps end no episode.
    return jax.lax.cond(jnp.any(ended), renew, lambda: reached)


class DeviceSession(SacSession):
    """Trainings whose environments are JAX functions, as members of one program.

    Args:
        configurations: What to train; they make one program.
        environment: The wrapped environment of the first, for its spaces and horizon.
        simulation: Its functions.
    """

    def __init__(
        self,
        configurations: Sequence[Configuration],
        environment: TaskWrapper,
        simulation: Simulation,
    ) -> None:
        first, self._number = configurations[0], len(configurations)
        super().__init__(first, environment)
        self._simulation = simulation
        reward = reward_of(configurations, environment)
        self._environment = device_environment(first.task, reward, environment)
        self._frames = frames_of(simulation, self.shape.observation)
        weights = [self.shape.weights(one.parameters, one.steps) for one in configurations]
        self._weights: Weights = jax.tree.map(lambda *values: jnp.stack(values), *weights)
        made = [self.shape.make(one.seed, one.parameters) for one in configurations]
        remembered = transitions(self.shape.settings, self._frames, self.shape.actions.outputs)
        self.notice = require_room(remembered, bytes_of(made[0]), self._number)
        members: Member = jax.tree.map(lambda *leaves: jnp.stack(leaves), *made)
        self._states: State = jax.jit(self._begun)(simulation, members)
        self._reports: Report | None = None
        self._pick = jax.jit(one_of)
        self._check = jax.jit(jax.vmap(holds_numbers))
        self._checked: tuple[int, np.ndarray] | None = None
        self._trace = jax.jit(self._traced)
        # Beside the first evaluation, which comes first and is compiled too.
        beside = ThreadPoolExecutor(1, "compilation")
        self._compiling = beside.submit(self._compiled)
        beside.shutdown(wait=False)

    @property
    def step(self) -> int:
        """Environment steps of each member so far."""
        return int(self._states.rounds) * self.shape.settings.round

    def learned(self, member: int) -> Member:
        """What a member has learned so far."""
        return self._pick(self._states.members, member)

    def is_finite(self, member: int) -> bool:
        """Whether its networks hold numbers; found out once a step for all."""
        if self._checked is None or self._checked[0] != self.step:
            self._checked = self.step, np.asarray(self._check(self._states.members))
        return bool(self._checked[1][member])

    def scalars(self, member: int) -> Mapping[str, float]:
        """What is told of a member's newest update."""
        return {} if self._reports is None else told(one_of(self._reports, member))

    def restore(self, member: int, contents: Mapping[str, bytes]) -> list[str]:
        """Go on from a capture: with running episodes and random numbers as they were."""
        found = unpack_tree(contents[STATE], self._part(member))
        rows = self._rows(member)
        states, some = self._states, (found.members, found.running)
        self._states = states._replace(
            members=jax.tree.map(lambda x, one: x.at[member].set(one), states.members, some[0]),
            running=jax.tree.map(lambda x, one: x.at[rows].set(one), states.running, some[1]),
            rounds=found.rounds,
        )
        self._checked = None
        return []

    def capture(self, member: int) -> dict[str, bytes]:
        """The whole state of a member but for its transitions."""
        return {STATE: pack_tree(self._part(member))}

    def ring(self, member: int) -> DeviceRing:
        """Its transitions."""
        return DeviceRing(self, self._rows(member))

    def advance(self, until: int) -> None:
        """As many chunks of rounds as it takes, but no more than a call should take."""
        chunk = self.shape.settings.round * CHUNK
        wanted = -(-(until - self.step) // chunk)
        number = max(1, min(wanted, UPDATES_A_CALL // (CHUNK * self._number)))
        self._states, reports = self._compiling.result()(
            self._simulation, self._states, self._weights, jnp.int32(number)
        )
        self._reports = jax.device_get(reports)

    def evaluate(self, seeds: Sequence[int], watch: Callable[[int], None]) -> list[list[Episode]]:
        """All episodes in one compiled call."""
        keys = np.stack([draw_key(np_random(seed)[0]) for seed in seeds])
        keys = np.tile(keys, (self._number, 1))
        found = jax.device_get(self._trace(self._simulation, self._states.members, keys))
        watch(len(seeds))
        # What a member that has diverged does is no episode.
        return [
            episodes_of(self._environment.task, found, seeds, member * len(seeds))
            if self.is_finite(member)
            else []
            for member in range(self._number)
        ]

    def close(self) -> None:
        """Nothing to close."""

    def _rows(self, member: int) -> slice:
        each = self.shape.settings.environments
        return slice(member * each, (member + 1) * each)

    def _part(self, member: int) -> Part:
        rows, states = self._rows(member), self._states
        return Part(
            members=self._pick(states.members, member),
            running=jax.tree.map(lambda leaf: leaf[rows], states.running),
            rounds=states.rounds,
        )

    def _begun(self, simulation: Simulation, members: Member) -> State:
        return begin(self.shape, self._environment, self._frames, simulation, members)

    def _compiled(self) -> Any:
        program = partial(train, self.shape, self._environment, self._frames)
        lowered = jax.jit(program, donate_argnums=1).lower(
            self._simulation, self._states, self._weights, jnp.int32(1)
        )
        return lowered.compile()

    def _traced(self, simulation: Simulation, members: Member, keys: Array) -> Traces:
        def policy(observation: Array) -> Array:
            rows = observation.reshape(self._number, -1, observation.shape[-1])
            found = of_members(self.shape.best)(members, rows)
            return found.reshape(len(keys), *found.shape[2:])

        return trace(self._environment, simulation, policy, keys)


class DeviceRing:
    """The transitions of one member, as they are kept on disk.

    Args:
        session: Whose buffer it is.
        rows: The member's environments in it.
    """

    def __init__(self, session: DeviceSession, rows: slice) -> None:
        self._session, self._rows = session, rows

    @property
    def _buffer(self) -> Buffer:
        return self._session._states.buffer

    @property
    def capacity(self) -> int:
        """Rows that it holds at most: steps of all of the member's environments."""
        return len(self._buffer.reward)

    @property
    def rows(self) -> int:
        """Rows that it was given since the training began."""
        return self._session.step // self._session.shape.settings.environments

    @property
    def row_bytes(self) -> int:
        """Memory of a row."""
        return sum(leaf[0, self._rows].nbytes for leaf in self._buffer)

    def read(self, places: np.ndarray) -> dict[str, np.ndarray]:
        """Some rows, by their places."""
        # Padded to a power of two, so that there are few programs.
        wide = np.resize(places, 1 << (len(places) - 1).bit_length())
        rows = np.arange(self._rows.start, self._rows.stop)
        found = jax.device_get(_gathered(self._buffer, wide, rows))
        return {name: leaf[: len(places)] for name, leaf in found._asdict().items()}

    def write(self, places: np.ndarray, rows: Mapping[str, np.ndarray]) -> None:
        """Put rows at their places."""
        states = self._session._states
        filled = {
            name: leaf.at[places, self._rows].set(rows[name])
            for name, leaf in states.buffer._asdict().items()
        }
        self._session._states = states._replace(buffer=Buffer(**filled))


@jax.jit
def _gathered(buffer: Buffer, places: Array, rows: Array) -> Buffer:
    return jax.tree.map(lambda leaf: leaf[places[:, None], rows], buffer)
