"""Registers `png16`: values from 0 to 1, such as ambient occlusion, as a linear 16-bit grey PNG."""

from __future__ import annotations

from baker.core.encoding import ENCODINGS
from baker.encodings.grey_png import GreyPng

ENCODINGS.register("png16")(GreyPng(16))
