"""Programs of a scene's own, in place of the general right-hand side (docs/decisions/0092)."""
