"""Scene files in; GLB, manifest and folders out."""
