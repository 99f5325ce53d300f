"""Animations and snapshots of results."""
