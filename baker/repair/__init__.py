"""`baker check --fix` and `--repair`: meshes rewritten where that keeps their look."""
