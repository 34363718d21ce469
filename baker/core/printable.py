"""Converts text from files to text without control characters, for terminals, logs, reports and JSON.

Readers keep names as they are in the file. Each output converts them: text with `printable`, and JSON with
`json_text`.
"""

from __future__ import annotations

import json
import re
import unicodedata
from typing import Any

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


def json_text(value: Any, *, indent: int | None = None, only_ascii: bool = False) -> str:
    r"""Return a value as JSON, in which invisible characters are escapes such as `\u001b`.

    JSON itself requires escapes only for the characters below U+0020. A reader of the JSON gets the names of
    the scene unchanged.

    Parameters
    ----------
    value : object
        A value that consists of dicts, lists, strings, finite numbers, booleans and None.
    indent : int or None
        Spaces for each level of nesting; None writes one line.
    only_ascii : bool
        Whether all other characters above U+007F are escapes, too.

    Returns
    -------
    str
        JSON, which can be encoded as UTF-8.

    Raises
    ------
    ValueError
        If a number is not finite.
    """
    text = json.dumps(value, indent=indent, ensure_ascii=only_ascii, allow_nan=False)
    lines = text.split("\n")
    return "\n".join(line if line.isprintable() else "".join(map(_in_json, line)) for line in lines)


def without_surrogates(text: str) -> str:
    r"""Return a text that UTF-8 can encode: lone surrogates are replaced by escapes such as `\ud800`.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        The text without surrogates.
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _shown(letter: str) -> str:
    if letter in "\n\r\t":
        return " "
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii") if _is_hidden(letter) else letter


def _in_json(letter: str) -> str:
    if not _is_hidden(letter):
        return letter
    units = letter.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[k : k + 2].hex()}" for k in range(0, len(units), 2))


def _is_hidden(letter: str) -> bool:
    # The last two code points of each Unicode plane are not characters. XML forbids two of these code points.
    hidden = unicodedata.category(letter) in _ESCAPED or ord(letter) & 0xFFFE == 0xFFFE
    return hidden and letter not in _JOINERS
