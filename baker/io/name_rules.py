"""Recognises objects that no player sees by their names: collision hulls and lower levels of detail."""

from __future__ import annotations

import re

# Kind of object, and the names by which it is recognised. Case is ignored. Blender appends a number such as
# `.001` to names that occur twice.
_NUMBER = r"(\.\d{3,})?$"
_KINDS = (
    # Line 1: prefixes of Unreal. Line 2: suffixes of Godot. Line 3: words at the end of a name, with or
    # without a number.
    (
        "collision hull",
        r"^(ucx|ubx|usp|ucp|mcdcx)_"
        rf"|-(col|colonly|convcolonly|navmesh|occonly){_NUMBER}"
        r"|(^|[_.\- ])(collision|collider|hitbox)([_.\- ]?\d*)$",
    ),
    ("lower level of detail", rf"_lod0*[1-9]\d*{_NUMBER}"),
)
_PATTERNS = tuple((kind, re.compile(text, re.IGNORECASE)) for kind, text in _KINDS)


def unseen_kind(name: str) -> str | None:
    """Return the kind of object that a name denotes if no player sees such objects.

    Parameters
    ----------
    name : str
        Name of a node or mesh.

    Returns
    -------
    str or None
        "collision hull", "lower level of detail", or None for all other names.
    """
    return next((kind for kind, pattern in _PATTERNS if pattern.search(name)), None)
