"""Converts text from files to one line without control characters, for terminals, logs and reports."""

from __future__ import annotations

import re
import unicodedata

# Length above which a value from a file is shortened in a message, characters.
LONGEST_VALUE = 80
# Format characters that are not escaped, because words contain them: zero-width joiner and non-joiner
# (Arabic, Indic and emoji sequences) and the soft hyphen.
_JOINERS = "\u200c\u200d\u00ad"
# Unicode categories of escaped characters: control characters, surrogates, line separators, paragraph
# separators, and format characters, some of which reverse the direction of text.
_ESCAPED = frozenset({"Cc", "Cs", "Zl", "Zp", "Cf"})
# A long value between single quotes that is not a path. An apostrophe after a letter does not begin a value.
_QUOTED = re.compile(rf"(?<!\w)'([^'/\\]{{{LONGEST_VALUE + 1},}})'(?!\w)")


def printable(text: str) -> str:
    r"""Return a text in one line, with invisible characters as escapes such as `\x1b`.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The text, in which line breaks and tabs are replaced by spaces. Other characters of the categories
        `_ESCAPED` (except `_JOINERS`) and code points that are not characters are replaced by escapes.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(map(_shown, text.replace("\r\n", " ")))


def shortened(text: str, most: int = LONGEST_VALUE) -> str:
    """Return the result of `printable` for a value, with at most `most` characters.

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


def message_line(text: str) -> str:
    """Return the result of `printable` for a message, with long quoted values replaced by `shortened` values.

    Parameters
    ----------
    text : str
        The message. Values from a file are between single quotes. Values with a slash or a backslash are not
        shortened, because they may be paths.

    Returns
    -------
    str
        The message in one line.
    """
    return _QUOTED.sub(lambda found: f"'{shortened(found[1])}'", printable(text))


def printable_lines(text: str) -> str:
    """Return a text of several lines, after applying `printable` to each line.

    Parameters
    ----------
    text : str
        Lines, separated by line feeds.

    Returns
    -------
    str
        The lines, as many as in `text`.
    """
    if text.isascii() and text.replace("\n", "").isprintable():
        return text
    return "\n".join(map(printable, text.split("\n")))


def _shown(letter: str) -> str:
    if letter in "\n\r\t":
        return " "
    # Also escape the last two code points of each Unicode plane, which are not characters. XML forbids two of
    # these code points.
    if letter in _JOINERS or not (unicodedata.category(letter) in _ESCAPED or ord(letter) & 0xFFFE == 0xFFFE):
        return letter
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")
