"""Validation of a scene: all mistakes at once, and the validated scene."""
