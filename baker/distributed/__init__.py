"""One bake, or many, on a dask.distributed cluster."""
