"""The tiles of one bake, or whole bakes, on a dask.distributed cluster."""
