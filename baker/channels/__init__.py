"""Plugins: quantities that can be baked, one channel a file."""
