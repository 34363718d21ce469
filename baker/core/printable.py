"""Text of files, made fit for terminals, logs and reports: one line without control characters."""

from __future__ import annotations

import unicodedata

# Longest value of a file that a message repeats, characters.
LONGEST_VALUE = 80
# Format characters that belong to words: joiners of Arabic, Indic and emoji sequences, soft hyphens.
_JOINERS = "\u200c\u200d\u00ad"
# Control characters, surrogates, separators of lines and paragraphs; format characters, which reverse text.
_ESCAPED = frozenset({"Cc", "Cs", "Zl", "Zp", "Cf"})


def printable(text: str) -> str:
    r"""Return a text in one line, with control characters as escapes such as `\x1b`.

    Parameters
    ----------
    text : str
        Any text. Line breaks and tabs become blanks.

    Returns
    -------
    str
        The same object if nothing had to be replaced.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(map(_shown, text.replace("\r\n", " ")))


def shortened(text: str, most: int = LONGEST_VALUE) -> str:
    """Return a value for a message: printable, and cut to `most` characters.

    Parameters
    ----------
    text : str
        The value, such as a name of a node.
    most : int
        Most characters that are kept.

    Returns
    -------
    str
        With "..." in place of what was cut.
    """
    text = printable(text[: 2 * most])
    return text if len(text) <= most else f"{text[: most - 3]}..."


def _shown(letter: str) -> str:
    if letter in "\n\r\t":
        return " "
    if letter in _JOINERS or unicodedata.category(letter) not in _ESCAPED:
        return letter
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")
