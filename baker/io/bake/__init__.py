"""The output folder of a bake: replaced as a whole, locked, read back; its manifest."""
