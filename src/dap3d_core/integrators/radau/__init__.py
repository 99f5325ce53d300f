"""Radau IIA of order 5 on the stabilised index-2 equations of motion."""
