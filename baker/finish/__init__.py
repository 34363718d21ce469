"""Turns texel values into finished pages: fills invalid texels, removes noise, extends charts."""
