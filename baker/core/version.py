"""Defines the version of baker; packaging and all other modules read it here."""

from __future__ import annotations

VERSION = "0.1.0"
