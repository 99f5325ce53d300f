"""The native layer: models as C libraries and FMUs, which run without Python."""
