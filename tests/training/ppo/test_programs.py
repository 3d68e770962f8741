"""Members of one program learn what each would learn alone, and one that fails stops no other."""

import subprocess
import sys
from dataclasses import replace

import pytest

from hprs.errors import RunError, UsageError
from hprs.training.configure import configure
from hprs.training.interruption import Interruption
from hprs.training.listener import Silence
from hprs.training.ppo import program_of, train, train_together
from hprs.training.run_directory import create_runs
from tests.training.ppo.point import ID, TASK

SMALL = {"environments": 4, "n_steps": 8, "batch_size": 16, "n_epochs": 2}

IN_FLOAT64 = """
import jax
import jax.numpy as jnp
import numpy as np
from functools import partial
from hprs.training.actions import BoxActions
from hprs.training.ppo.learner import Rollout, Shape
from hprs.training.ppo.settings import Settings

jax.config.update("jax_enable_x64", True)
shape = Shape(Settings(environments=4, n_steps=8, batch_size=16, n_epochs=2), 3, 2, BoxActions(1, (-1.0,), (1.0,), (1,)))
weights = shape.weights({**vars(shape.settings), "learning_rate": 1e-3}, 1000)
weights = jax.tree.map(lambda x: x.astype(jnp.float64), weights)

def wide(tree):
    return jax.tree.map(lambda x: x.astype(jnp.float64) if jnp.issubdtype(x.dtype, jnp.floating) else x, tree)

def rollout(key):
    keys = jax.random.split(key, 9)
    normal = lambda i, *shape: jax.random.normal(keys[i], (8, 4, *shape))
    coin = lambda i: jax.random.bernoulli(keys[i], 0.1, (8, 4))
    return Rollout(normal(0, 3), normal(1, 2), normal(2, 1), normal(3) - 1, normal(4), coin(5), coin(6), ~coin(7), normal(8, 3), normal(1, 2))

def learn(seed, member):
    def update(member, number):
        made = wide(rollout(jax.random.fold_in(jax.random.key(seed), number)))
        return shape.update(member, made, weights, number)[0], None
    return jax.lax.scan(update, member, jnp.arange(100))[0].parameters

seeds = jnp.arange(3)
members = [wide(shape.make(seed)) for seed in range(3)]
together = jax.jit(jax.vmap(learn))(seeds, jax.tree.map(lambda *all_: jnp.stack(all_), *members))
for seed in range(3):
    alone = jax.jit(learn)(seed, members[seed])
    for one, all_ in zip(jax.tree.leaves(alone), jax.tree.leaves(together)):
        assert one.dtype == jnp.float64
        np.testing.assert_allclose(all_[seed], one, rtol=1e-6, atol=1e-9)
assert not np.allclose(together.policy[0].weights[0], together.policy[0].weights[1])
print("equal")
"""


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    file = tmp_path_factory.mktemp("task") / "point.hprs"
    file.write_text(TASK)
    return str(file)


@pytest.fixture(scope="module")
def point(task):
    def configured(seed=0, steps=96, **settings):
        return configure(
            ID,
            task_path=task,
            steps=steps,
            evaluation_interval=64,
            evaluation_episodes=2,
            settings={**SMALL, **settings},
            seed=seed,
        )

    return configured


def test_a_member_of_100_updates_is_what_it_would_be_alone():
    """In float64, to 1e-6; in float32 other roundings would grow."""
    run = subprocess.run(
        [sys.executable, "-c", IN_FLOAT64], capture_output=True, text=True, check=False
    )
    assert run.stdout == "equal\n", run.stderr


def test_members_differ_in_seeds_and_in_what_is_no_shape(point):
    same = {program_of(point(seed=3)), program_of(point(learning_rate=0.1, ent_coef=0.5))}
    assert same == {program_of(point())}
    # The reward may know the discount.
    for other in (
        point(n_epochs=3),
        point(gamma=0.5),
        point(critic_signals=False),
        point(steps=97),
    ):
        assert program_of(other) != program_of(point())


def test_one_that_diverges_stops_no_other(tmp_path, point):
    second = point(seed=1)
    absurd = replace(second, parameters={**second.parameters, "learning_rate": 1e30})
    members = [point(seed=0), absurd, point(seed=2)]
    runs = create_runs(members, tmp_path)
    with Interruption(lambda: None) as interruption:
        first, diverged, last = train_together(runs, [Silence()] * 3, interruption)
    assert first is True
    assert last is True
    assert isinstance(diverged, RunError)
    assert "diverged" in str(diverged)
    steps = [sorted({row["step"] for row in run.evaluations()}) for run in runs]
    assert steps == [[0, 64, 96], [0], [0, 64, 96]]
    assert runs[0].policy_file("last").read_bytes() != runs[2].policy_file("last").read_bytes()


def test_stopped_members_go_on_together(tmp_path, point):
    class Impatient(Silence):
        def __init__(self, interruption):
            self.interruption = interruption

        def evaluated(self, step, summary):
            self.interruption.requested = step == 64

    whole = create_runs([point(seed=0), point(seed=1)], tmp_path / "whole")
    parts = create_runs([point(seed=0), point(seed=1)], tmp_path / "parts")
    with Interruption(lambda: None) as interruption:
        assert train_together(whole, [Silence()] * 2, interruption) == [True, True]
        stopped = train_together(parts, [Impatient(interruption)] * 2, interruption)
        assert stopped == [False, False]
    with Interruption(lambda: None) as interruption:
        assert train_together(parts, [Silence()] * 2, interruption) == [True, True]
    for one, other in zip(whole, parts, strict=True):
        assert one.evaluations() == other.evaluations()
    # Nothing is left to do.
    with Interruption(lambda: None) as interruption:
        assert train_together(parts, [Silence()] * 2, interruption) == [True, True]


def test_what_python_steps_is_no_member_of_a_program(tmp_path):
    pole = configure("hprs/CartPole-v0", steps=64, settings=SMALL)
    runs = create_runs([pole, replace(pole, seed=1)], tmp_path)
    with (
        Interruption(lambda: None) as interruption,
        pytest.raises(UsageError, match="stepped by Python"),
    ):
        train_together(runs, [Silence()] * 2, interruption)


def test_a_run_that_was_stopped_before_its_last_evaluation_is_not_complete(tmp_path, point):
    class Late(Silence):
        def __init__(self, interruption):
            self.interruption = interruption

        def advanced(self, step):
            self.interruption.requested = step >= 96

    [whole], [run] = (create_runs([point()], tmp_path / name) for name in ("whole", "run"))
    assert train(whole, Silence())
    with Interruption(lambda: None) as interruption:
        assert train_together([run], [Late(interruption)], interruption) == [False]
    assert run.policy_step("last") == 64
    assert train(run, Silence())
    assert run.evaluations() == whole.evaluations()
    assert run.policy_step("last") == 96
    # Now it is: nothing is evaluated again.
    assert train(run, Silence())
    assert run.evaluations() == whole.evaluations()
