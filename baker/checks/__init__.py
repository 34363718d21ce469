"""Checks of a scene before it is baked: the runner, its reports, and shared facts."""
