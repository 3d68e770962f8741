"""The documented environment of a user's own: what the page says of it is so."""

import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from hprs.training.configure import configure

EXAMPLES = Path(__file__).parents[2] / "examples"
ID, TASK = "own_jax_environment:Drone-v0", EXAMPLES / "drone.hprs"


@pytest.fixture
def drone(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import own_jax_environment

    return own_jax_environment


def test_a_drone_without_commands_hovers(drone):
    simulation = drone.make_drone().simulation
    state, *_ = simulation.reset(jax.random.key(0))
    level = state._replace(angle=jnp.zeros(()))
    after, *_ = simulation.step(level, jnp.zeros(2))
    np.testing.assert_allclose(jnp.stack(after), jnp.stack(level), atol=1e-6)


def test_a_fall_is_that_of_gravity(drone):
    simulation = drone.make_drone(gravity=2.0).simulation
    state, *_ = simulation.reset(jax.random.key(0))
    after, *_ = simulation.step(state, -jnp.ones(2))
    # No thrust: in a step of 0.05 s the fall gains 0.1 m/s, of Euler's method 5 mm.
    assert after.vz == pytest.approx(-0.1)
    assert after.z - state.z == pytest.approx(-0.005, abs=1e-6)


def test_it_is_trained_as_jax_functions(drone):
    from hprs.training.ppo.on_device import DeviceSession
    from hprs.training.ppo.training import open_session

    configuration = configure(ID, task_path=str(TASK), settings={"environments": 2, "n_steps": 128})
    session = open_session([configuration])
    assert isinstance(session, DeviceSession)
    session.advance(1)
    assert session.step == 256


def test_the_script_flies_an_episode():
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "own_jax_environment.py")],
        capture_output=True,
        text=True,
        env={**os.environ, "JAX_PLATFORMS": "cpu"},
        check=True,
    )
    assert "pam=" in done.stdout
