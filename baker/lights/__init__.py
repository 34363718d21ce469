"""Light families, one a file."""
