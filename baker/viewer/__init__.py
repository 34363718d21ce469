"""A local page that shows a bake: what it is made of, and the server that hands it out."""

from baker.viewer.script import ThreeScript, find_three
from baker.viewer.server import ViewServer, make_server

__all__ = ["ThreeScript", "ViewServer", "find_three", "make_server"]
