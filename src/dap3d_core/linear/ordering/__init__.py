"""Elimination orders: nested dissection, supernodes."""
