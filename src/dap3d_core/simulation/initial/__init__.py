"""Initial conditions: assembly, undefined directions, singular starts, tolerances."""
