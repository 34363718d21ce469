"""The error for a name that nothing has: settings, channels, exports, limits, rules of a check."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from baker.core.errors import SettingsError


def unknown_name(
    what: str,
    name: str,
    known: Iterable[str],
    *,
    file: str | None = None,
    object: str | None = None,
    listed: str | None = None,
) -> SettingsError:
    """Return the error that tells the nearest known name, if one is near, and all of them.

    Parameters
    ----------
    what : str
        What the name was to be, in the singular: "channel".
    name : str
        As it was given. Case and dashes for underscores do not count in the search for the nearest.
    known : iterable of str
        In the order in which they are told.
    file, object : str or None
        As `SettingsError` takes them.
    listed : str or None
        Said instead of the known names, where they are too many for a sentence.
    """
    known = list(known)
    folded = {_fold(other): other for other in known}
    near = get_close_matches(_fold(name), folded, n=1)
    names = listed or f"known are {', '.join(known)}"
    hint = f"did you mean '{folded[near[0]]}'? ({names})" if near else names
    return SettingsError(f"there is no {what} '{name}'; {hint}", file=file, object=object)


def _fold(name: str) -> str:
    return name.lower().replace("-", "_")
