"""The local page that shows a bake, its server, and the data that it serves."""
