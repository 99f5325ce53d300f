"""User events: definition, sampling, location."""
