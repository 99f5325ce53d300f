"""Derivatives of whole runs by parameters of their scene."""
