"""One car, one lap: fast, in the middle, and without touching a wall."""
