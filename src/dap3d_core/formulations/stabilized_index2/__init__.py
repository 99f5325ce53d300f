"""Stage equations of implicit methods on the stabilised index-2 equations, and their Jacobian."""
