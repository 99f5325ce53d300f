"""SDF."""

interface_version = 1
