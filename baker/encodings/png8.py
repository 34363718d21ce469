"""Ambient occlusion and other shares as a 8-bit grey PNG: 0 is closed, 255 is open, no curve."""

from __future__ import annotations

from baker.core.encoding import ENCODINGS
from baker.encodings.grey_png import GreyPng

ENCODINGS.register("png8")(GreyPng(8, remedy="use png16 or the EXR"))
