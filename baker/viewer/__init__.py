"""The local page that shows a bake, its server, and the data it hands out."""

from baker.viewer.script import ThreeScript, find_three
from baker.viewer.server import ViewServer, make_server

__all__ = ["ThreeScript", "ViewServer", "find_three", "make_server"]
