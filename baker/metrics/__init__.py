"""Error metrics of lightmaps against reference values, and limits on these metrics."""
