"""The only part that knows Embree."""
