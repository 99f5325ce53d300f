"""Unsymmetric block LU factorisation."""
