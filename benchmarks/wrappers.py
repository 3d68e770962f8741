"""What a task costs: one environment, a batch of 4,096, and one pass over 4 million samples in JAX.

    .venv/bin/python benchmarks/wrappers.py

Everything is a ratio to a bare LunarLander-v3 step, measured in the same run.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import gymnasium as gym
import numpy as np
from _common import driving_task, lander, lander_step, lander_task, seconds

import hprs

BATCH, TIME = 4_096, 1_000


class Replay(gym.vector.VectorEnv):
    """A vector environment that returns prepared numbers: all the cost is the wrapper's."""

    metadata = {"autoreset_mode": gym.vector.AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self.num_envs = BATCH
        self.single_observation_space = gym.spaces.Box(-10.0, 10.0, (1,))
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, (2,))
        self.observation = rng.uniform(0, 5, (BATCH, 1)).astype(np.float32)
        names = {"progress": 0.9, "wall": 1.0, "hit": 0.4, "jerk": 2.8}
        self.infos = {
            name: rng.uniform(0, high, BATCH).astype(np.float32) for name, high in names.items()
        }
        self.zeros, self.never = np.zeros(BATCH), np.zeros(BATCH, bool)
        # A stand-in for the flag of Gymnasium's native environments; nothing ends here.
        self.prev_done = np.zeros(BATCH, bool)

    def reset(self, *, seed=None, options=None):
        """The prepared numbers."""
        return self.observation, dict(self.infos)

    def step(self, actions):
        """The prepared numbers."""
        return self.observation, self.zeros, self.never, self.never, dict(self.infos)


def single() -> None:
    """`hprs.wrap` on the lander."""
    task = lander_task()
    # In turns, so that other work on the machine disturbs both alike.
    pairs = [
        (lander_step(lander()), lander_step(hprs.wrap(lander(), task, end_on_violation=False)))
        for _ in range(12)
    ]
    bare, wrapped = (min(times) for times in zip(*pairs, strict=True))
    added = wrapped - bare
    print(f"bare LunarLander step              {bare * 1e6:8.2f} us  (the yardstick)")
    print(
        f"hprs.wrap, five requirements adds  {added * 1e6:8.2f} us  = {added / bare:.3f} yardsticks"
    )
    batch(bare)


def batch(yardstick: float) -> None:
    """`hprs.wrap_vector` on 4,096 sub-environments."""
    envs = hprs.wrap_vector(Replay(), driving_task())
    envs.reset(seed=0)
    actions = np.random.default_rng(1).uniform(-1, 1, (BATCH, 2)).astype(np.float32)
    each = seconds(lambda: envs.step(actions), repeats=200) / BATCH
    print(
        f"hprs.wrap_vector, {BATCH} x seven        {each * 1e9:8.1f} ns an environment-step  "
        f"= 1/{yardstick / each:.0f} yardstick"
    )


def jitted() -> None:
    """Reward and assessment of 4,096 x 1,000 samples in one jitted pass."""
    import jax
    import jax.numpy as jnp

    from hprs.semantics import assessment
    from hprs.semantics.evaluation import evaluate
    from hprs.semantics.plan import plan_of

    task = driving_task()
    plan, reward = plan_of(task), hprs.make_reward("hprs", task)
    rng = np.random.default_rng(0)
    highs = {name: bounds.high for name, bounds in task.ranges.items()}
    trace = {
        name: jnp.asarray(rng.uniform(0, 0.9 * high, (TIME + 1, BATCH)), jnp.float32)
        for name, high in highs.items()
    }

    @jax.jit
    def run(trace):
        first = {name: value[0] for name, value in trace.items()}
        carry = (reward.init(first), assessment.start(plan, evaluate(task, first).satisfied))
        never = jnp.zeros(BATCH, bool)

        def step(carry, signals):
            memory, tally = carry
            memory, paid = reward.step(memory, signals, never, never)
            tally = assessment.advance(plan, tally, evaluate(task, signals).satisfied)
            return (memory, tally), paid

        rest = {name: value[1:] for name, value in trace.items()}
        (_, tally), rewards = jax.lax.scan(step, carry, rest)
        return rewards.sum(0), assessment.conclude(plan, tally).pam

    took = seconds(lambda: jax.block_until_ready(run(trace)), repeats=7)
    print(
        f"JAX scan, reward + assessment      {took / (BATCH * TIME) * 1e9:8.2f} ns a sample, "
        f"{BATCH} x {TIME} in {took:.3f} s on {jax.devices()[0].platform}"
    )


if __name__ == "__main__":
    single()
    jitted()
