"""Converts text from files to one line without control characters, for terminals, logs and reports."""

from __future__ import annotations

import unicodedata

# Largest length of a value from a file in a message, characters.
LONGEST_VALUE = 80
# Format characters that are not escaped, because words contain them: zero-width joiner and non-joiner
# (Arabic, Indic and emoji sequences) and the soft hyphen.
_JOINERS = "\u200c\u200d\u00ad"
# Unicode categories of escaped characters: control characters, surrogates, line separators, paragraph
# separators, and format characters, some of which reverse the direction of text.
_ESCAPED = frozenset({"Cc", "Cs", "Zl", "Zp", "Cf"})


def printable(text: str) -> str:
    r"""Return a text in one line, with control characters as escapes such as `\x1b`.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The text after line breaks and tabs are replaced by spaces and control characters by escapes.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(map(_shown, text.replace("\r\n", " ")))


def shortened(text: str, most: int = LONGEST_VALUE) -> str:
    """Return a value for a message, in the form of `printable` and with at most `most` characters.

    Parameters
    ----------
    text : str
        The value, such as the name of a node.
    most : int
        Largest number of characters.

    Returns
    -------
    str
        The value; if it is too long, its end is replaced by "...".
    """
    text = printable(text[: 2 * most])
    return text if len(text) <= most else f"{text[: most - 3]}..."


def _shown(letter: str) -> str:
    if letter in "\n\r\t":
        return " "
    if letter in _JOINERS or unicodedata.category(letter) not in _ESCAPED:
        return letter
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")
