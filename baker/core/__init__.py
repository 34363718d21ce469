"""Scene, settings, results, errors, and the interfaces of plugins; imports no other package."""
