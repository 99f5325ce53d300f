"""From MATLAB structures to a scene."""
