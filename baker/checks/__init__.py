"""Checks a scene before it is baked: the rules, the data that they share, the runner and the reports."""
