"""Gymnasium glue: puts a task on an environment or a vector environment."""
