"""Elimination orders: nested dissection, supernodes, bisection."""
