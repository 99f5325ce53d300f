"""Batches of points: compiled runs, parameter maps, rebuilt models, lanes."""
