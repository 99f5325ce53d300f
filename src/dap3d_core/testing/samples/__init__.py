"""Random types, elements and states that checks are run on."""
