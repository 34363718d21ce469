"""The stages of a bake in order, and the data passed between them."""
