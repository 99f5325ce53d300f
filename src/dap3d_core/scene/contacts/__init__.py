"""Contacts of a scene and their materials."""
