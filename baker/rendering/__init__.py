"""Pictures of a scene: path-traced, of its ambient occlusion, or lit by a bake."""

from baker.rendering.render import Picture, render
from baker.rendering.settings import RenderSettings
from baker.rendering.write import check_image, write_picture

__all__ = ["Picture", "RenderSettings", "check_image", "render", "write_picture"]
