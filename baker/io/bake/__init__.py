"""A bake's output folder: written as a whole, locked, read back; the manifest."""
