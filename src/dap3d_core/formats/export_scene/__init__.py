"""A scene as an articulated model."""
