"""Sparse block LDL^T factorisation of the saddle-point matrix."""
