"""Signals of a scene: functions that combine others, and inputs."""
