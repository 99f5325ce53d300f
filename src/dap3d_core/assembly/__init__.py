"""The assembly layer: positions -> C, J; velocities -> nu, gamma; forces."""
