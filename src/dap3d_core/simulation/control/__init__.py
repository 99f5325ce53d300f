"""Controllers of a run: sampled, and their inputs held."""
