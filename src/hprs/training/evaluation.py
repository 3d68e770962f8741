"""Runs a policy on seeded episodes, and assesses each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hprs.semantics.assessment import Assessment
from hprs.training.policies import BatchedPolicy, Policy
from hprs.wrappers.single import TaskWrapper

TRAINING_SEEDS = 1_000_000
"""First episode seed of the evaluations during a training, which choose the best policy."""

FINAL_SEEDS = 2_000_000
"""First episode seed of a policy's assessment: episodes that chose nothing."""

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


def training_seeds(number: int, count: int) -> list[int]:
    """Seeds of the episodes of a training's evaluation.

    Args:
        number: How many evaluations came before it: none of the first million episodes is one of
            another evaluation, and none at all is one of a final assessment.
        count: How many episodes an evaluation has, at most `FINAL_SEEDS - TRAINING_SEEDS`.
    """
    different = (FINAL_SEEDS - TRAINING_SEEDS) // count
    return episode_seeds(TRAINING_SEEDS + number % different * count, count)


def episode_seeds(first: int, count: int) -> list[int]:
    """Seeds of `count` episodes."""
    return list(range(first, first + count))


def evaluate(
    make: Callable[[], TaskWrapper],
    policy: Policy,
    seeds: Sequence[int],
    watch: Callable[[int], None] | None = None,
) -> list[Episode]:
    """Run one episode a seed, in environments of its own.

    Args:
        make: Makes an environment with its task; its episodes must end.
        policy: What to run. A `BatchedPolicy` runs several episodes at once.
        seeds: One seed an episode; the same seeds give the same episodes.
        watch: Called after every step with the number of episodes that are complete; what it
            raises ends the evaluation.

    Raises:
        PolicyError: The policy fails, or its action is none of the environment's.
    """
    episodes: list[Episode] = []
    batched = policy if isinstance(policy, BatchedPolicy) else None
    width = 1 if batched is None else min(SIDE_BY_SIDE, len(seeds))
    environments = [make() for _ in range(width)]
    choose = (lambda seen: [policy(seen[0])]) if batched is None else batched.batch
    try:
        for start in range(0, len(seeds), width):
            chosen = seeds[start : start + width]
            steps = _run(environments[: len(chosen)], choose, chosen, episodes)
            for complete in steps:
                if watch is not None:
                    watch(complete)
    finally:
        for environment in environments:
            environment.close()
    return episodes


def _run(
    environments: Sequence[TaskWrapper],
    choose: Callable[[Sequence[Any]], Sequence[Any]],
    seeds: Sequence[int],
    episodes: list[Episode],
) -> Iterator[int]:
    """Step environments until all episodes have ended, and add these to `episodes`.

    Yields:
        After every step, the number of episodes that are complete.
    """
    seen = {i: env.reset(seed=seeds[i])[0] for i, env in enumerate(environments)}
    totals = [0.0] * len(seeds)
    found: dict[int, Episode] = {}
    while seen:
        running = list(seen)
        actions = choose([seen[i] for i in running])
        for i, action in zip(running, actions, strict=True):
            seen[i], reward, terminated, truncated, info = environments[i].step(action)
            totals[i] += float(reward)
            if terminated or truncated:
                found[i] = Episode(seeds[i], totals[i], info["assessment"])
                del seen[i]
        yield len(episodes) + len(found)
    episodes += [found[i] for i in range(len(seeds))]
