"""Scene files: TOML in, TOML out, line numbers."""
