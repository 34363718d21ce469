"""One file an engine: what it needs to show a bake."""
