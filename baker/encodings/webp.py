"""Registers `webp`: RGBM in a lossless WebP picture, the smallest format for web pages."""

from __future__ import annotations

from baker.core.encoding import ENCODINGS
from baker.encodings.rgbm import PictureFormat, RgbmEncoding
from baker.io.webp import WEBP_LARGEST, decode_webp, encode_webp, webp_size

_WEBP = PictureFormat(".rgbm.webp", encode_webp, decode_webp, webp_size, WEBP_LARGEST)
ENCODINGS.register("webp")(RgbmEncoding(_WEBP))
