"""Output of a run: recorder, progress, free space, error estimate."""
