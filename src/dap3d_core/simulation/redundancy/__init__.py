"""Redundant and nearly redundant constraints."""
