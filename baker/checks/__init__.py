"""Checks of a scene before it is baked: shared data of the rules, the runner, reports."""
