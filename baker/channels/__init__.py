"""Channels: the quantities that can be baked; each file registers one channel."""
