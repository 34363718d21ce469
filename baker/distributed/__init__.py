"""Runs the tiles of one bake, or whole bakes, on the workers of a dask.distributed cluster."""
