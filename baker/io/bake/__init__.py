"""Writes, locks, replaces and reads the output folder of a bake and its manifest `bake.json`."""
