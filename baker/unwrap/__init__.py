"""Lightmap uv: unwrap, pack, keep, check."""
