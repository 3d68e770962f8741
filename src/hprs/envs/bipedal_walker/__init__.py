"""A two-legged walker that has to reach a goal, on even and on hardcore terrain."""
