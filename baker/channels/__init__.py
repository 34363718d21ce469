"""Plugins: what can be baked, one channel a file."""
