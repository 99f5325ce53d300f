"""Parameter estimation from measured data."""
