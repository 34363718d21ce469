"""Repairs of finished maps: invalid texels, denoise, dilation."""
