"""Analyses of a scene other than its simulation, one file or folder each."""
