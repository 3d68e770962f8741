"""Soft actor-critic in JAX."""

from hprs.training.sac.training import program_of as program_of
from hprs.training.sac.training import train as train
from hprs.training.sac.training import train_together as train_together
