"""Proximal policy optimisation in JAX."""

from hprs.training.ppo.training import train as train
