"""Driving with JAX's 64-bit numbers switched on, which other code in a process may need."""

from __future__ import annotations

import os
import subprocess
import sys

CODE = """
import gymnasium, jax, numpy as np
from hprs.envs import functional

assert jax.numpy.zeros(()).dtype == np.float64
name = "hprs/FollowLeader-v0"
env, envs = gymnasium.make(name), gymnasium.make_vec(name, 2)
for one, action in ((env, np.zeros(2, np.float32)), (envs, np.zeros((2, 2), np.float32))):
    first, second = one.reset(seed=0)[0], one.step(action)[0]
    assert first.dtype == second.dtype == np.float32
simulation = functional.make(name)
reset = jax.eval_shape(simulation.reset, jax.random.key(0))
step = jax.eval_shape(simulation.step, reset[0], np.zeros(2, np.float32))
wide = [leaf for leaf in jax.tree.leaves((simulation, reset, step)) if leaf.dtype.itemsize == 8]
assert wide == [], wide
"""


def test_an_episode_stays_in_32_bits_where_jax_has_64():
    found = subprocess.run(
        [sys.executable, "-c", CODE],
        env={**os.environ, "JAX_ENABLE_X64": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (found.returncode, found.stderr) == (0, "")
