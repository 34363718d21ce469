"""Wires the stages of a bake in order: world, transport, finished pages."""
