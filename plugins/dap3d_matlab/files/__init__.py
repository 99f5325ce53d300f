"""Files of a MATLAB model and the report of their import."""
