"""The assembly floor: positions -> C, J; velocities -> nu, gamma; forces."""
