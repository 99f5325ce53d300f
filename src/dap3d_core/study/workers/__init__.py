"""Workers of a study: threads of this machine, dask clusters."""
