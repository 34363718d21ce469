"""Baker: radiosity lightmaps and ambient occlusion for game assets."""
