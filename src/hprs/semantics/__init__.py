"""What a task says of states and episodes: pure functions of arrays."""
