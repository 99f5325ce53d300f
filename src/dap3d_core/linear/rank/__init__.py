"""Rank and null space of the constraint Jacobian."""
