"""Quantities of a result: catalogue, lookup by name, tables and data sets."""
