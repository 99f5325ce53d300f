"""Sweeps: points, data set, incrementally written file."""
