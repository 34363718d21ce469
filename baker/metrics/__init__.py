"""Figures of error, limits on them, and reports."""
