"""The native floor: models as C libraries and FMUs, which run without Python."""
