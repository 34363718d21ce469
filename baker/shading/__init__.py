"""Materials and what lets light through, resolved for triangles."""
