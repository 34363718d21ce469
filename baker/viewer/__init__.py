"""A local page that shows a bake."""
