"""Measures of error between maps, and limits on them."""
