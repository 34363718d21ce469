"""Pictures of a scene: path-traced, of its ambient occlusion, or lit by a bake."""
