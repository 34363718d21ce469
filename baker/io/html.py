"""Escapes text from files for HTML pages."""

from __future__ import annotations

import html

from baker.core.printable import printable


def escaped(text: str) -> str:
    """Return a text for HTML: markup is escaped, and control characters are made printable.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The escaped text, one line.
    """
    return html.escape(printable(text))
