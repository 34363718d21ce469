"""Runs the stages of a bake in order, and passes data between them."""
