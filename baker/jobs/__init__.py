"""Bakes many scenes: which are out of date, worker processes, limits on memory."""
