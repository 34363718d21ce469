"""Builds the error for an unknown name, such as that of a setting, a channel, an export or a rule."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import TypeVar

from baker.core.errors import BakerError, SettingsError
from baker.core.foreign_names import foreign_answer

E = TypeVar("E", bound=BakerError)


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is most similar to a name.

    Parameters
    ----------
    name : str
        The name. Case is ignored, and dashes count as underscores.
    known : iterable of str
        The known names.

    Returns
    -------
    str or None
        One of `known`, or None if none is similar.
    """
    folded = {_fold(other): other for other in known}
    near = get_close_matches(_fold(name), folded, n=1)
    return folded[near[0]] if near else None


def unknown_name(
    what: str,
    name: str,
    known: Iterable[str],
    *,
    file: str | None = None,
    object: str | None = None,
    listed: str | None = None,
    error: type[E] = SettingsError,  # type: ignore[assignment]
) -> E:
    """Return the error for an unknown name, with the most similar known name and a list of the known names.

    Parameters
    ----------
    what : str
        What the names denote, in the singular: "channel".
    name : str
        The unknown name. The search for a similar name ignores case and treats dashes as underscores.
    known : iterable of str
        The known names, in the order in which the message lists them.
    file : str or None
        Attribute `file` of the error.
    object : str or None
        Attribute `object` of the error.
    listed : str or None
        Text that replaces the list of known names if that list is too long for a sentence.
    error : type
        Class of the error: `SettingsError`, or `InputError` for a name in a scene file.

    Returns
    -------
    BakerError
        The error; the caller raises it.
    """
    known = list(known)
    near = nearest_name(name, known)
    names = listed or f"known are {', '.join(known)}"
    hint = names if near is None else f"did you mean '{near}'? ({names})"
    return error(f"there is no {what} '{name}'; {hint}", file=file, object=object)


def unknown_setting(
    what: str, name: str, known: Iterable[str], *, file: str | None = None, object: str | None = None
) -> SettingsError:
    """Return the error for an unknown setting.

    If another program has the setting, the error names the setting of `baker` with the same purpose, or a
    section of LIMITS.md, see `foreign_answer`. Otherwise it is the error of `unknown_name`.

    Parameters
    ----------
    what : str
        What the names denote, in the singular: "setting".
    name : str
        The unknown name.
    known : iterable of str
        The known settings.
    file : str or None
        Attribute `file` of the error.
    object : str or None
        Attribute `object` of the error.

    Returns
    -------
    SettingsError
        The error; the caller raises it.
    """
    settings = {setting.replace("_", "-"): setting for setting in known}
    found = foreign_answer(name, settings)
    if found is None:
        return unknown_name(what, name, settings.values(), file=file, object=object)
    verb, instead = found
    hint = f"use '{settings[instead]}'" if verb == "use" else f"see {instead}"
    return SettingsError(f"there is no {what} '{name}'; {hint}", file=file, object=object)


def _fold(name: str) -> str:
    return name.lower().replace("-", "_")
