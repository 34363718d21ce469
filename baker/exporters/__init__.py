"""Plugins: one engine a file; an export reads a finished folder and nothing else."""
