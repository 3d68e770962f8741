"""Gymnasium glue: puts a task on an environment or a vector environment."""

from hprs.wrappers.single import wrap as wrap
from hprs.wrappers.vector import wrap_vector as wrap_vector

__all__ = ["wrap", "wrap_vector"]
