"""Rewards and assessment of a JAX environment inside one compiled `lax.scan`.

    python examples/with_jax_scan.py --steps 200

Needs `pip install 'hprs[jax]'`. A reward is two pure functions, `init` and `step`; its memory is
part of what the scan carries. Episodes that end begin anew in place, as trainers on a device do it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp

import hprs
from hprs.rewards import safety_cost
from hprs.semantics.assessment import Assessment

TASK = hprs.load_task(Path(__file__).with_name("park.hprs"))
REWARD, COST = hprs.make_reward("hprs", TASK), safety_cost(TASK)
DISCOUNT, TIME_STEP, HORIZON, COPIES = 0.99, 0.1, 100, 64


def signals_of(state: Any, force: Any) -> dict[str, Any]:
    """What the task reads."""
    return {"x": state["x"], "v": state["v"], "force": force}


def reset(key: Any) -> dict[str, Any]:
    """A mass at rest, somewhere."""
    return {"x": jax.random.uniform(key, minval=-2.0), "v": jnp.float32(0), "step": jnp.int32(0)}


def advance(state: Any, force: Any) -> dict[str, Any]:
    """A mass that a force pushes."""
    v = state["v"] + force * TIME_STEP
    return {"x": state["x"] + v * TIME_STEP, "v": v, "step": state["step"] + 1}


def policy(state: Any) -> Any:
    """Brakes and steers towards the mark, as a network would."""
    return jnp.clip(0.5 * (1.0 - state["x"]) - state["v"], -1, 1)


def transition(carry: Any, key: Any) -> tuple[Any, Any]:
    """One step of one environment; where the episode ends, the next one begins."""
    state, memory = carry
    force = policy(state)
    state = advance(state, force)
    signals = signals_of(state, force)
    # The task ends an episode where safety is violated; nothing else does but the horizon.
    terminated = COST.step(None, signals, False, False)[1] > 0
    truncated = state["step"] >= HORIZON
    memory, reward = REWARD.step(memory, signals, terminated, truncated)
    fresh = reset(key)
    begun = (fresh, REWARD.init(signals_of(fresh, jnp.float32(0))))
    ended = terminated | truncated
    carry = jax.tree.map(lambda new, old: jnp.where(ended, new, old), begun, (state, memory))
    return carry, (reward, ended, signals)


@jax.jit
def roll_out(keys: Any) -> Any:
    """All steps of one environment, and the signals of its states from s_0 on."""
    state = reset(keys[0])
    first = signals_of(state, jnp.float32(0))
    _, (rewards, ended, signals) = jax.lax.scan(transition, (state, REWARD.init(first)), keys[1:])
    trace = jax.tree.map(lambda one, rest: jnp.concatenate([one[None], rest]), first, signals)
    return rewards, ended, trace


def first_episodes(ended: Any, trace: Any) -> list[Assessment]:
    """Assesses the first episode of every copy: up to its own end, or as far as it has come."""
    steps = jnp.where(ended.any(axis=0), ended.argmax(axis=0) + 1, len(ended)).tolist()
    return [
        hprs.assess(TASK, {name: values[: count + 1, copy] for name, values in trace.items()})
        for copy, count in enumerate(steps)
    ]


def main() -> None:
    """Run a batch, and assess the first episode of every copy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=200)
    steps = parser.parse_args().steps
    keys = jax.random.split(jax.random.key(0), (COPIES, steps + 1))
    # `vmap` puts the copies first; a trace has time first.
    rewards, ended, trace = jax.vmap(roll_out, out_axes=1)(keys)
    print(f"{COPIES} copies of {steps} steps: {rewards.mean():.4f} a step, {ended.sum()} ends.")
    found = first_episodes(ended, jax.device_get(trace))
    for label in TASK.labels:
        print(f"{label:>8} {sum(one.requirements[label] for one in found) / COPIES:.2f}")


if __name__ == "__main__":
    main()
