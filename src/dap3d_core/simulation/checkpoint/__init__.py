"""Checkpoints: file format and writer."""
