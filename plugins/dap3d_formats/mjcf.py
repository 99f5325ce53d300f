"""MJCF."""

interface_version = 1
