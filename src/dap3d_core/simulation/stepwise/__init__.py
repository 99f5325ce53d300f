"""Runs that a script takes step by step."""
