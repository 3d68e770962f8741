"""Trains with Stable-Baselines3, and loads what it has trained."""

from hprs.training.sb3.policy import Learner as Learner
from hprs.training.sb3.policy import load_policy as load_policy
from hprs.training.sb3.policy import load_zip as load_zip
from hprs.training.sb3.settings import hyperparameters as hyperparameters
from hprs.training.sb3.training import train as train
