"""The car simulator: vehicle, track, lidar, collision, leader; pure JAX functions of one world."""
