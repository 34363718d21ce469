"""Bakes on more than one machine."""
