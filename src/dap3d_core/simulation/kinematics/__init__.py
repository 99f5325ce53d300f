"""Kinematics and inverse dynamics: motions that drivers or data prescribe."""
