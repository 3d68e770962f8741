"""Every reward, step by step, pays what its definition says of the whole episode.

On floats, NumPy batches, PyTorch and JAX's `scan`, with episodes of different lengths side by side.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

from hprs.rewards import REWARDS
from hprs.spec.task import Task
from tests.rewards.episodes import VARIANTS, expected, floats, random_trace, rollout, tasks, variant

TASKS = tasks(8)
BATCH, LONGEST = 6, 14


def batch(seed: int, task: Task) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Traces, and for each the step at which it ends, terminated or truncated."""
    rng = np.random.default_rng(seed)
    trace = random_trace(seed, task, (LONGEST, BATCH))
    return trace, rng.integers(1, LONGEST, BATCH), rng.integers(1, 4, BATCH)


def flags(last: np.ndarray, how: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    ended = last == step
    return ended & (how & 1 > 0), ended & (how & 2 > 0)


@cache
def wanted(name: str, number: int) -> list[np.ndarray]:
    """For each episode of a batch what its steps pay."""
    task = TASKS[number]
    trace, last, _ = batch(number, task)
    return [
        expected(name, task, {k: v[: last[i] + 1, i] for k, v in trace.items()})
        for i in range(BATCH)
    ]


def test_there_is_a_variant_of_every_reward():
    assert {name for name, _ in VARIANTS.values()} == set(REWARDS)


@pytest.mark.parametrize("number", range(len(TASKS)))
@pytest.mark.parametrize("name", VARIANTS)
def test_on_floats(name, number):
    task = TASKS[number]
    trace, last, how = batch(number, task)
    for i in range(BATCH):
        one = floats({k: v[: last[i] + 1, i] for k, v in trace.items()})
        terminated, truncated = bool(how[i] & 1), bool(how[i] & 2)
        paid = rollout(variant(name, task), one, terminated=terminated, truncated=truncated)
        np.testing.assert_allclose(paid, wanted(name, number)[i], atol=1e-12)


def batched(reward: Any, trace: dict[str, Any], last: Any, how: Any, convert: Any) -> np.ndarray:
    memory, paid = reward.init({k: convert(v[0]) for k, v in trace.items()}), []
    for step in range(1, LONGEST):
        ends = map(convert, flags(last, how, step))
        memory, value = reward.step(memory, {k: convert(v[step]) for k, v in trace.items()}, *ends)
        assert value.shape[0] == BATCH
        paid.append(np.asarray(value))
    return np.asarray(paid)


@pytest.mark.parametrize(("convert", "tolerance"), [(np.asarray, 1e-12), (torch.asarray, 1e-6)])
@pytest.mark.parametrize("number", range(len(TASKS)))
@pytest.mark.parametrize("name", VARIANTS)
def test_on_batches(name, number, convert, tolerance):
    task = TASKS[number]
    trace, last, how = batch(number, task)
    paid = batched(variant(name, task), trace, last, how, convert)
    for i, rewards in enumerate(wanted(name, number)):
        np.testing.assert_allclose(paid[: last[i], i], rewards, atol=tolerance)


@pytest.mark.parametrize("convert", [np.asarray, torch.asarray])
@pytest.mark.parametrize("number", range(len(TASKS)))
@pytest.mark.parametrize("name", VARIANTS)
def test_nan_pays_the_same_on_floats_and_in_one_row_of_a_batch(name, number, convert):
    """A measurement that failed is hidden in no form, and spreads to no other row."""
    task = TASKS[number]
    trace, last, how = batch(number, task)
    whole = batched(variant(name, task), trace, last, how, convert)
    row, bad = int(np.argmax(last)), int(last.max()) // 2
    trace = {k: v.copy() for k, v in trace.items()}
    for values in trace.values():
        values[bad, row] = np.nan
    paid = batched(variant(name, task), trace, last, how, convert)
    one = floats({k: v[: last[row] + 1, row] for k, v in trace.items()})
    ends = {"terminated": bool(how[row] & 1), "truncated": bool(how[row] & 2)}
    wanted = rollout(variant(name, task), one, **ends)
    np.testing.assert_allclose(paid[: last[row], row], wanted, atol=1e-6)
    others = np.arange(BATCH) != row
    np.testing.assert_array_equal(paid[:, others], whole[:, others])


@pytest.mark.parametrize("number", range(len(TASKS)))
def test_in_one_scan(number):
    task = TASKS[number]
    trace, last, how = batch(number, task)
    rewards = {name: variant(name, task) for name in VARIANTS}
    signals = {k: jnp.asarray(v, jnp.float32) for k, v in trace.items()}
    ends = [flags(last, how, step) for step in range(1, LONGEST)]
    terminated, truncated = (jnp.asarray(found) for found in zip(*ends, strict=True))

    @jax.jit
    def run(signals: Any) -> Any:
        first = {k: v[0] for k, v in signals.items()}
        rest = {k: v[1:] for k, v in signals.items()}

        def step(memories: Any, now: Any) -> Any:
            found = {name: rewards[name].step(memories[name], *now) for name in rewards}
            return {k: m for k, (m, _) in found.items()}, {k: v for k, (_, v) in found.items()}

        begun = {name: reward.init(first) for name, reward in rewards.items()}
        return jax.lax.scan(step, begun, (rest, terminated, truncated))[1]

    paid = run(signals)
    in_float32 = {k: np.asarray(v, np.float64) for k, v in signals.items()}
    for i in range(BATCH):
        one = {k: v[: last[i] + 1, i] for k, v in in_float32.items()}
        for name in rewards:
            whole = expected(name, task, one)
            found = np.asarray(paid[name])[: last[i], i]
            np.testing.assert_allclose(found, whole, atol=3e-5, err_msg=name)


@pytest.mark.parametrize("name", VARIANTS)
def test_stepping_leaves_a_memory_as_it_was(name):
    """Two continuations of one memory do not disturb each other, as between pure functions."""
    task = TASKS[1]
    trace = floats({k: v[:, 0] for k, v in batch(1, task)[0].items()})
    at = [{k: v[t] for k, v in trace.items()} for t in range(LONGEST)]
    reward = variant(name, task)
    straight = rollout(reward, trace, terminated=True, truncated=False)
    memory, paid = reward.init(at[0]), []
    for t in range(1, LONGEST):
        detour = memory
        for other in range(LONGEST - 1, LONGEST - 1 - t % 5, -1):
            detour, _ = reward.step(detour, at[other], False, False)
        memory, value = reward.step(memory, at[t], t == LONGEST - 1, False)
        paid.append(value)
    np.testing.assert_array_equal(np.asarray(paid), straight)
