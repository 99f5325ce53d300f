"""Interpreter of the MATLAB subset that models are written in."""
