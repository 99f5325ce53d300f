"""Derivation of J, gamma and nu from C by symbolic differentiation."""
