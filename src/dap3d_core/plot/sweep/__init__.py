"""Plots of sweeps: curves, maps, parallel coordinates."""
