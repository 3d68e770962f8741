"""Populations in one program: members are who they would be alone, with rewards of their own."""

import os
import subprocess
import sys
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.training.configure import configure
from hprs.training.sac.on_device import CHUNK, DeviceSession
from hprs.training.sac.training import open_session, program_of
from hprs.training.several import Several
from tests.training.ppo.point import ID, TASK

SMALL = {
    "buffer_size": 400,
    "batch_size": 16,
    "net_arch": [8],
    "learning_starts": 50,
}
SEEDS = range(1_000_000, 1_000_004)


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    file = tmp_path_factory.mktemp("task") / "point.hprs"
    file.write_text(TASK)
    return str(file)


@pytest.fixture(scope="module")
def point(task):
    return partial(configured, task)


def configured(task, seed=0, reward="hprs", **settings):
    return configure(
        ID,
        task_path=task,
        reward=reward,
        algorithm="sac",
        steps=10_000,
        settings={**SMALL, **settings},
        seed=seed,
    )


def learned(configurations, chunks):
    session = open_session(configurations)
    while session.step < chunks * CHUNK:
        session.advance(chunks * CHUNK)
    return session


def close(one, other, tolerance):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance)


IN_FLOAT64 = """
import sys
import jax
from tests.training.sac.test_programs import CHUNK, SEEDS, SMALL, close, configured, learned

members = [
    configured(sys.argv[1], seed=3),
    configured(sys.argv[1], seed=4, reward="env", learning_rate=0.01),
    configured(sys.argv[1], seed=5, reward="tltl"),
]
together = learned(members, 33)
assert together.step - SMALL["learning_starts"] >= 1_000
for index, configuration in enumerate(members):
    alone = learned([configuration], 33)
    assert alone.learned(0).targets[0][0].weights.dtype == "float64"
    close(alone.learned(0), together.learned(index), 1e-6)
    one, other = alone.evaluate(SEEDS, print)[0], together.evaluate(SEEDS, print)[index]
    assert [e.assessment.length for e in one] == [e.assessment.length for e in other]
"""


def test_a_member_of_1000_updates_is_what_it_would_be_alone(task):
    """In float64, beside members of other seeds, rewards and rates."""
    run = subprocess.run(
        [sys.executable, "-c", IN_FLOAT64, task],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "JAX_ENABLE_X64": "1"},
    )
    assert run.returncode == 0, run.stderr


def test_members_share_a_program_unless_a_shape_differs(point):
    programs = {program_of(point(seed=seed, reward=r)) for seed in (0, 1) for r in ("hprs", "env")}
    programs |= {program_of(point(gamma=0.5, tau=0.1, ent_coef="auto", learning_rate=0.1))}
    assert len(programs) == 1 and None not in programs
    assert program_of(point(batch_size=32)) not in programs
    assert program_of(configure("hprs/BipedalWalker-v0", algorithm="sac")) is None


def test_every_row_is_paid_by_the_reward_of_its_member():
    class Pays:
        def __init__(self, worth):
            self.worth = worth

        def init(self, signals):
            return signals["x"]

        def step(self, memory, signals, terminated, truncated):
            return memory + 1, self.worth * memory

    several = Several((Pays(1.0), Pays(10.0)), (1, 0, 1))
    memory = several.init({"x": jnp.arange(6.0)})
    no = jnp.zeros(6, bool)
    memory, paid = several.step(memory, {}, no, no)
    assert paid.tolist() == [0.0, 10.0, 2.0, 3.0, 40.0, 50.0]
    _, paid = several.step(memory, {}, no, no)
    assert paid.tolist() == [10.0, 20.0, 3.0, 4.0, 50.0, 60.0]


def test_a_resumed_session_is_one_that_never_stopped(point):
    whole = learned([point(), point(seed=1)], 4)
    again = open_session([point(), point(seed=1)])
    assert isinstance(again, DeviceSession)
    for member in range(2):
        assert again.restore(member, whole.capture(member)) == []
        ring, kept = again.ring(member), whole.ring(member)
        assert (ring.rows, ring.capacity) == (kept.rows, 400) and kept.rows == 4 * CHUNK
        places = np.arange(ring.rows) % ring.capacity
        ring.write(places, kept.read(places))
    for session in (whole, again):
        session.advance(session.step + 1)
    for member in range(2):
        close(whole.learned(member), again.learned(member), 0)
        assert whole.evaluate(SEEDS, print) == again.evaluate(SEEDS, print)


def test_learning_starts_after_random_steps(point):
    first, later = (learned([point()], chunks).learned(0).parameters for chunks in (1, 2))
    new = open_session([point()]).learned(0).parameters
    close(first, new, 0)
    assert not np.array_equal(later.policy[0].weights, new.policy[0].weights)


def test_what_does_not_fit_is_refused_with_what_would(point, monkeypatch):
    from hprs.errors import UsageError
    from hprs.training.sac import memory

    monkeypatch.setattr(memory, "free", lambda: 60_000)
    with pytest.raises(UsageError, match=r"8 members at once need .* fit, or all of them with"):
        open_session([point(seed=seed) for seed in range(8)])
    assert "KiB of memory" in open_session([point()]).notice
