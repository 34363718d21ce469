"""Mends scenes where that cannot change their look."""
