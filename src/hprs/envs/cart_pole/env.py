"""Gymnasium's cart pole, unchanged: its physics, its reward of 1 a step, 0.02 s a step."""

from gymnasium.envs.classic_control.cartpole import CartPoleEnv as CartPole
from gymnasium.envs.classic_control.cartpole import CartPoleVectorEnv as CartPoleVector

__all__ = ["CartPole", "CartPoleVector"]
