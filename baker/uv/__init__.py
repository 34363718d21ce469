"""Lightmap uv: made with xatlas or kept from the input, packed into pages, and checked."""
