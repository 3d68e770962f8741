"""Environments of one number in which the right values and actions are known."""

import gymnasium as gym
import numpy as np
from gymnasium import spaces

TASK = "signal x = obs[0] in [-1, 1]\nencourage any: x <= 2\n"


class Probe(gym.Env):
    """An episode of so many steps; `reward` of the step, and whether the end is the task's."""

    observation_space = spaces.Box(-1.0, 1.0, (1,), np.float32)
    action_space = spaces.Discrete(2)
    steps = 1

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.time = 0
        return self.seen(), {}

    def seen(self):
        return np.array([self.time], np.float32)

    def reward(self, action):
        return 1.0

    def step(self, action):
        reward = self.reward(action)
        self.time += 1
        return self.seen(), reward, self.time == self.steps, False, {}


class Terminal(Probe):
    """Reward 1, and the end."""


class Endless(Probe):
    """Reward 1 for ever, of which the horizon cuts off 5 steps at a time."""

    steps = 10**9

    def seen(self):
        return np.zeros(1, np.float32)


class Credit(Probe):
    """Reward only for the second of two steps."""

    steps = 2

    def reward(self, action):
        return float(self.time)


class Sign(Probe):
    """One step, in which the sign of the observation is the right action."""

    def seen(self):
        if self.time == 0:
            self.sign = self.np_random.choice([-1.0, 1.0])
        return np.array([self.sign], np.float32)

    def reward(self, action):
        return float(action == (self.sign > 0))


class Follow(Sign):
    """One step, in which half of the observation is the right action."""

    action_space = spaces.Box(-2.0, 2.0, (1,), np.float32)

    def reward(self, action):
        return -float((action[0] - self.sign / 2) ** 2)


HORIZON = 5
for kind in (Terminal, Endless, Credit, Sign, Follow):
    gym.register(f"{kind.__name__}Probe-v0", kind, max_episode_steps=HORIZON)
    # The same for learners whose actions are numbers.
    of_numbers = type(kind.__name__, (kind,), {"action_space": Follow.action_space})
    gym.register(f"{kind.__name__}BoxProbe-v0", of_numbers, max_episode_steps=HORIZON)
