"""Steps environments that are no JAX functions, many at once, for a learner."""

from hprs.training.host.choice import make_host as make_host
from hprs.training.host.interface import HostEnvironments as HostEnvironments
from hprs.training.host.interface import Seen as Seen
from hprs.training.host.interface import Transition as Transition
from hprs.training.host.single import SingleEnvironments as SingleEnvironments
from hprs.training.host.vector import VectorEnvironments as VectorEnvironments

__all__ = [
    "HostEnvironments",
    "Seen",
    "SingleEnvironments",
    "Transition",
    "VectorEnvironments",
    "make_host",
]
