"""Shows a bake in a browser: the page, the local server, and the data that it serves."""
