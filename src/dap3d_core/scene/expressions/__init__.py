"""Expressions in scenes, and what is written with them."""
