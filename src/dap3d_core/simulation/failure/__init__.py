"""Causes of failed runs, and notes on doubtful ones."""
