"""Plugins: the checks, one subject a file, one function a code."""
