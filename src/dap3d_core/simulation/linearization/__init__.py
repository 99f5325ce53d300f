"""Linearised equations of motion: state-space matrices, eigenvalues, modes."""
