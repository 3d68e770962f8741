"""Proximal policy optimisation in JAX."""

from hprs.training.ppo.training import program_of as program_of
from hprs.training.ppo.training import train as train
from hprs.training.ppo.training import train_together as train_together
