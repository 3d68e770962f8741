"""The numbers of docs/paper.md: how the scripted pilot lands, and how the scripted gait walks.

Bare environments, without tasks: what is counted is written here once more, in other words. Takes
about a minute.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import gymnasium as gym
import numpy as np

import hprs.envs
from hprs.envs.bipedal_walker.gait import Gait
from hprs.envs.lunar_lander.pilot import fly

LANDER = "hprs/LunarLanderObstacle-v0"
WALKERS = ("hprs/BipedalWalker-v0", "hprs/BipedalWalkerHardcore-v0")
LANDINGS, WALKS = 300, 40
"""Episodes of each obstacle, and of each policy on each terrain."""
PAD, TOLERANCES = 0.15, (0.0, 0.0001, 0.01)
"""Half the pad's width, and how far from it a lander may rest."""
BEAM = 0.225
"""What the paper takes off each beam of the lidar."""


def observations(
    env: gym.Env, policy: Callable[[np.ndarray], np.ndarray], seed: int
) -> Iterator[np.ndarray]:
    """What an episode shows after each of its steps."""
    observation, _ = env.reset(seed=seed)
    ended = False
    while not ended:
        observation, _, terminated, truncated, _ = env.step(policy(observation))
        ended = terminated or truncated
        yield observation


def landings() -> None:
    """Where landers rest, and how fast they turn."""
    resting, spins = [], []
    for obstacle in ((0.0, 0.2), (-0.1, 0.1)):
        env = gym.make(LANDER, obstacle=obstacle, disable_env_checker=True)
        ends = []
        for seed in range(LANDINGS):
            seen = np.array(list(observations(env, fly, seed)))
            spins.append(np.abs(seen[:, 5]))
            ends.append(seen[-1])
        x, y, touched = np.array(ends)[:, [0, 1, 12]].T
        distance = np.hypot(np.maximum(np.abs(x) - PAD, 0), y)
        landed = (distance <= TOLERANCES[-1]) & (touched == 0)
        print(f"obstacle {obstacle}: {landed.sum()} of {LANDINGS} episodes end on the pad")
        resting += [*zip(y[landed], distance[landed], strict=True)]
    y, distance = np.array(resting).T
    print(f"y at rest: {y.min():.4f} to {y.max():.4f}, mean {y.mean():.4f}")
    for tolerance in TOLERANCES:
        print(f"  at most {tolerance} from the pad: {np.mean(distance <= tolerance):.1%}")
    spin = np.concatenate(spins)
    print(f"spin <= 0.5 in {np.mean(spin <= 0.5):.1%} of the steps as observed, ", end="")
    print(f"in {np.mean(spin * 2.5 <= 0.5):.1%} as rad/s")


def walks() -> None:
    """Where walkers fall, what their lidar sees, and how fast their hulls turn."""
    falls, shortest, close, swings = 0, [], {"gait": 0, "random": 0}, []
    for name in WALKERS:
        env = gym.make(name, disable_env_checker=True)
        env.action_space.seed(0)
        policies = {"gait": Gait(), "random": lambda _, env=env: env.action_space.sample()}
        for policy_name, policy in policies.items():
            for seed in range(WALKS):
                seen = np.array(list(observations(env, policy, seed)))
                beams = seen[:, 14:24].min(axis=1)
                fell = bool(env.unwrapped.game_over)
                falls += fell
                if fell:
                    shortest.append(beams[-1])
                close[policy_name] += not fell and bool((beams < BEAM).any())
                if policy_name == "gait":
                    swings.append(np.abs(seen[:, 1]))
    print(f"falls: {falls} of {4 * WALKS} episodes; the shortest beam at each: ", end="")
    print(f"{min(shortest):.2f} to {max(shortest):.2f}")
    print(f"no fall, but a beam below {BEAM}: {close} of {2 * WALKS} episodes each")
    swing = np.concatenate(swings)
    print(f"angular velocity <= 0.25 in {np.mean(swing <= 0.25):.1%} of the gait's steps ", end="")
    print(f"as observed, in {np.mean(swing * 25 <= 0.25):.1%} as rad/s")


if __name__ == "__main__":
    hprs.envs.register()
    landings()
    walks()
