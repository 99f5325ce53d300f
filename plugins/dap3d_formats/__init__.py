"""The standard file formats: URDF, SDF, MJCF."""
