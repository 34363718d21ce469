"""Ambient occlusion and other shares as a 16-bit grey PNG: 0 is closed, 65535 is open, no curve."""

from __future__ import annotations

from baker.core.encoding import ENCODINGS
from baker.encodings.grey_png import GreyPng

ENCODINGS.register("png16")(GreyPng(16))
