"""Checks of a scene before it is baked: what rules share, the runner, reports."""
