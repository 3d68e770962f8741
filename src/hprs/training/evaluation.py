"""Runs a policy on seeded episodes, and assesses each of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hprs.errors import UsageError
from hprs.semantics.assessment import Assessment
from hprs.training.policies import BatchedPolicy, Policy
from hprs.wrappers.single import TaskWrapper

TRAINING_SEEDS = 1_000_000
"""First episode seed of the evaluations during a training, which choose the best policy."""

FINAL_SEEDS = 2_000_000
"""First episode seed of a policy's assessment: episodes that chose nothing."""

LONGEST_EPISODE = 1_000_000
"""Steps after which an environment without a horizon is given up."""

SIDE_BY_SIDE = 16
"""Environments that a batched policy steps together."""


@dataclass(frozen=True)
class Episode:
    """What is recorded of one episode."""

    seed: int
    """Seed of the environment's reset."""
    total: float
    """Undiscounted return of the reward that the environment was wrapped with."""
    assessment: Assessment
    """How well the episode met the task."""


def episode_seeds(first: int, count: int) -> list[int]:
    """Seeds of `count` episodes."""
    return list(range(first, first + count))


def evaluate(
    make: Callable[[], TaskWrapper], policy: Policy, seeds: Sequence[int]
) -> list[Episode]:
    """Run one episode a seed, in environments of its own.

    Args:
        make: Makes an environment with its task.
        policy: What to run. A `BatchedPolicy` runs several episodes at once.
        seeds: One seed an episode; the same seeds give the same episodes.

    Raises:
        UsageError: An episode does not end.
    """
    episodes: list[Episode] = []
    batched = policy if isinstance(policy, BatchedPolicy) else None
    width = 1 if batched is None else min(SIDE_BY_SIDE, len(seeds))
    environments = [make() for _ in range(width)]
    choose = (lambda seen: [policy(seen[0])]) if batched is None else batched.batch
    for start in range(0, len(seeds), width):
        chosen = seeds[start : start + width]
        episodes += _run(environments[: len(chosen)], choose, chosen)
    for environment in environments:
        environment.close()
    return episodes


def _run(
    environments: Sequence[TaskWrapper],
    choose: Callable[[Sequence[Any]], Sequence[Any]],
    seeds: Sequence[int],
) -> list[Episode]:
    seen = {i: env.reset(seed=seeds[i])[0] for i, env in enumerate(environments)}
    totals = [0.0] * len(seeds)
    found: dict[int, Episode] = {}
    for _ in range(LONGEST_EPISODE):
        running = list(seen)
        actions = choose([seen[i] for i in running])
        for i, action in zip(running, actions, strict=True):
            seen[i], reward, terminated, truncated, info = environments[i].step(action)
            totals[i] += float(reward)
            if terminated or truncated:
                found[i] = Episode(seeds[i], totals[i], info["assessment"])
                del seen[i]
        if not seen:
            return [found[i] for i in range(len(seeds))]
    raise UsageError(
        f"an episode did not end within {LONGEST_EPISODE} steps. Give it a horizon: --horizon N"
    )
