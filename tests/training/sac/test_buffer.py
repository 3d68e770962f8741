"""What is remembered as frames comes back as the transitions that were made."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.envs import functional
from hprs.training.frames import Frames, frames_of
from hprs.training.sac.buffer import Buffer, added, empty, frame_of, sampled

LONG = 2**32 - 1


def drive(simulation, lengths, key=0):
    """Episodes of some lengths, cut off: transitions as (observation, action, reached, age)."""
    generator = np.random.default_rng(key)
    step, reset = jax.jit(simulation.step), jax.jit(simulation.reset)
    for number, length in enumerate(lengths):
        episode, seen, _ = reset(jax.random.key(100 * key + number))
        for age in range(length):
            action = generator.uniform(-1, 1, 2).astype(np.float32)
            episode, reached, *_ = step(episode, action)
            yield np.asarray(seen), action, np.asarray(reached), age, age == length - 1
            seen = reached


def filled(frames, capacity, rows):
    """A ring that was given rows of one environment each of two members."""
    buffer = empty(capacity, len(rows), frames, 2)
    for time, step in enumerate(zip(*rows, strict=True)):
        seen, action, reached, age, cut = (np.stack(column) for column in zip(*step, strict=True))
        row = Buffer(
            frame=frame_of(jnp.asarray(seen), frames),
            reached=frame_of(jnp.asarray(reached), frames),
            action=action,
            reward=np.full(len(rows), time, np.float32),
            terminated=np.zeros(len(rows), bool),
            truncated=cut,
            valid=np.ones(len(rows), bool),
            age=np.minimum(age, frames.depth).astype(np.uint8),
        )
        buffer = added(buffer, row, jnp.int32(time))
    return buffer


@pytest.mark.parametrize("name", ["hprs/SafeDriving-v0", "hprs/FollowLeader-v0"])
def test_a_frame_holds_what_is_new_and_history_is_that_of_earlier_frames(name):
    simulation = functional.make(name, tracks="gm")
    frames = frames_of(simulation, simulation.observation_size)
    assert frames.depth == max(2, simulation.stacked - 1)
    assert len(frames.newest) == 2 + simulation.beams + 1
    made = list(drive(simulation, [6]))
    for time, (seen, *_) in enumerate(made):
        again = [
            made[max(0, time - lag)][0][frames.newest[column]]
            for lag, column in zip(frames.lag, frames.column, strict=True)
        ]
        np.testing.assert_array_equal(seen, again)


@pytest.mark.parametrize("count", [1, 7, 20, 23, 40])
def test_what_is_drawn_was_made_across_ends_of_episodes_and_the_seam_of_the_ring(count):
    simulation = functional.make("hprs/FollowLeader-v0", tracks="gm")
    frames, capacity = frames_of(simulation, simulation.observation_size), 20
    rows = [
        list(drive(simulation, lengths, key))[:count]
        for key, lengths in ((1, [3, 1, 9, 2, 30]), (2, [1, 1, 5, 8, 40]))
    ]
    buffer = filled(frames, capacity, rows)
    bits = np.random.default_rng(0).integers(0, LONG, (2, 400)).astype(np.uint32)
    found = sampled(buffer, frames, jnp.asarray(bits), jnp.int32(count), 2)
    kept = range(max(0, count - capacity) + frames.depth * (count >= capacity), count)
    for member in range(2):
        times = np.asarray(found.reward[member]).astype(int)
        # Every step that is remembered whole is drawn, no other.
        assert set(times) == set(kept)
        for column, name in enumerate(("observation", "action", "reached")):
            wanted = np.stack([rows[member][time][column] for time in times])
            np.testing.assert_array_equal(getattr(found, name)[member], wanted)


def test_in_numpy_it_is_the_same():
    frames = Frames((2, 3), (0, 1, 0, 1), (1, 1, 0, 0))
    generator = np.random.default_rng(0)
    size = (10, 4)
    buffer = Buffer(
        frame=generator.normal(size=(*size, 2)),
        reached=generator.normal(size=(*size, 2)),
        action=generator.normal(size=(*size, 1)),
        reward=generator.normal(size=size),
        terminated=generator.random(size) < 0.5,
        truncated=generator.random(size) < 0.5,
        valid=generator.random(size) < 0.5,
        age=generator.integers(0, 2, size).astype(np.uint8),
    )
    bits = generator.integers(0, LONG, (2, 50)).astype(np.uint32)
    with jax.enable_x64(True):
        for count in (3, 10, 25):
            found = sampled(buffer, frames, bits, count, 2, np)
            wanted = sampled(
                Buffer(*map(jnp.asarray, buffer)), frames, jnp.asarray(bits), jnp.int32(count), 2
            )
            for one, other in zip(found, wanted, strict=True):
                np.testing.assert_array_equal(one, other)
