"""Gymnasium glue: puts a task on an environment or a vector environment."""

from hprs.wrappers.history import ActionHistory as ActionHistory
from hprs.wrappers.history import IncrementAction as IncrementAction
from hprs.wrappers.history import ObservationHistory as ObservationHistory
from hprs.wrappers.single import wrap as wrap
from hprs.wrappers.vector import wrap_vector as wrap_vector

__all__ = ["ActionHistory", "IncrementAction", "ObservationHistory", "wrap", "wrap_vector"]
