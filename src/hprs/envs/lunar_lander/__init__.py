"""A lander that has to fly round an obstacle to its pad, and stay there."""
