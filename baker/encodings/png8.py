"""Registers `png8`: values from 0 to 1, such as ambient occlusion, as a linear 8-bit grey PNG."""

from __future__ import annotations

from baker.core.encoding import ENCODINGS
from baker.encodings.grey_png import GreyPng

ENCODINGS.register("png8")(GreyPng(8, remedy="use png16 or the EXR"))
