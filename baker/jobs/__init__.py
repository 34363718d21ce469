"""Bakes the scenes of a job file that are not up to date, in worker processes, within a memory limit."""
