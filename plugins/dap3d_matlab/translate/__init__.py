"""Translation of MATLAB structures into a scene."""
