"""Formats numbers and percentages for users, with three significant digits and mostly without exponents."""

from __future__ import annotations

import math
from collections.abc import Sequence

# Number of significant digits, and number of decimals above which a number is written with an exponent.
_DIGITS, _DECIMALS = 3, 6
# Values at or above this magnitude are written with an exponent.
_LARGEST = 1e15


def number(value: float, *, signed: bool = False) -> str:
    """Return a number with three significant digits.

    Parameters
    ----------
    value : float
        The number.
    signed : bool
        Whether positive numbers get a plus sign.

    Returns
    -------
    str
        "0.0152", "12.3", "1230" or "65500". Trailing zeros of the decimals are left out, and digits of an
        integer part are zeros after the third. Magnitudes from 1e15 on have an exponent with three digits,
        "1.23e+15", and magnitudes below 1e-4 one with two digits, "1.2e-05".
    """
    if not math.isfinite(value):
        return f"{value:+}" if signed else f"{value}"
    if value == 0:
        return "0"
    sign = "+" if signed else ""
    # Round first, because 99.96 has another number of decimals than 100.
    rounded = float(f"{value:.{_DIGITS - 1}e}")
    if abs(rounded) >= _LARGEST:
        return f"{rounded:{sign}.{_DIGITS}g}"
    decimals = _DIGITS - 1 - math.floor(math.log10(abs(rounded)))
    if decimals > _DECIMALS:
        return f"{rounded:{sign}.1e}"
    text = f"{rounded:{sign}.{max(decimals, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def percent(share: float, *, signed: bool = False) -> str:
    """Return a share as a percentage with three significant digits.

    Parameters
    ----------
    share : float
        The share: 1 is 100 %.
    signed : bool
        Whether positive shares get a plus sign.

    Returns
    -------
    str
        "1.52%" for 0.0152. Percentages whose magnitude is below 0.0001 are "0%".
    """
    value = 100.0 * share
    return f"{number(0.0 if abs(value) < 1e-4 else value, signed=signed)}%"


def amount(value: float) -> str:
    """Return a number with three significant digits; large numbers have "million", "billion" or "trillion".

    Parameters
    ----------
    value : float
        The number.

    Returns
    -------
    str
        "12300" or "2.5 million".
    """
    for size, word in ((1e12, "trillion"), (1e9, "billion"), (1e6, "million")):
        if math.isfinite(value) and size <= abs(value) < 1e15:
            return f"{number(value / size)} {word}"
    return number(value)


def joined_names(names: Sequence[str], most: int = 3) -> str:
    """Return names in quotes, separated by commas; after `most` names, the number of the others.

    Parameters
    ----------
    names : sequence of str
        The names.
    most : int
        Largest number of names that are written.

    Returns
    -------
    str
        "'a', 'b' and 'c'", or "'a', 'b', 'c' and 7 others".
    """
    shown = [f"'{name}'" for name in names[:most]]
    rest = len(names) - len(shown)
    shown += [f"{rest} other{'s' if rest > 1 else ''}"] if rest else []
    return " and ".join(filter(None, (", ".join(shown[:-1]), shown[-1]))) if shown else ""
