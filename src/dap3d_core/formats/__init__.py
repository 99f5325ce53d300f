"""The formats layer: models of other programs as scenes, and scenes as their models."""
