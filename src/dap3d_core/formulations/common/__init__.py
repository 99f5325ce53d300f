"""Parts that formulations share: constraint rows, projection, friction, switching functions."""
