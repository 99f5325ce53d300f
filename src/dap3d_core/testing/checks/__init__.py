"""Checks of joints, forces and functions."""
