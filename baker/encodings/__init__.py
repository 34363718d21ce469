"""How a map is stored, one encoding a file."""
