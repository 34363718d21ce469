"""Lightmap uv: cut with xatlas or kept from the input, packed into pages, checked."""
