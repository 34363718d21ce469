"""Bounds of what a bake can reckon with."""

from __future__ import annotations

# The strongest light there may be, in cd, lx or cd/m2: squares of what it brings are float32 numbers still.
# The sun's disc has 2e9 cd/m2.
BRIGHTEST = 1e15
