"""Pictures of a scene: path-traced radiance, ambient occlusion, or the radiance that a bake gives."""
