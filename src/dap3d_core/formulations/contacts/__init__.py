"""Contacts at one state: which are closed, stick and slip from there on, and what impacts do."""
