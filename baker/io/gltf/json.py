"""Gives typed access to the members of parsed JSON, with errors that name the member."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NoReturn

from baker.core.errors import InputError
from baker.core.printable import without_surrogates


class JsonObject:
    """A JSON object of a document with its path in the document.

    Parameters
    ----------
    value : dict
        The members. A value of another type raises an error when a member is read.
    where : str
        Path such as "accessors[3].sparse"; empty for the root.
    file : str
        Name of the file, for messages.
    """

    # Use slots to save memory, because files may have a million objects.
    __slots__ = ("_lists", "_value", "file", "where")

    def __init__(self, value: Any, where: str, file: str) -> None:
        self._value = value
        self.where = where
        self.file = file
        self._lists: dict[str, list[JsonObject]] | None = None

    @property
    def value(self) -> dict[str, Any]:
        """Return the members.

        Raises
        ------
        InputError
            If the value is no object.
        """
        if not isinstance(self._value, dict):
            self.fail(f"expected an object, found {_show(self._value)}")
        return self._value

    def __contains__(self, key: str) -> bool:
        """Return whether the member exists."""
        return key in self.value

    def fail(self, message: str, key: str = "") -> NoReturn:
        """Raise `InputError` about this object, or about its member `key`."""
        raise InputError(message, file=self.file, object=self.path_of(key) or None)

    def path_of(self, key: str = "") -> str:
        """Return the path of the member, such as "nodes[2].mesh"."""
        return f"{self.where}.{key}" if self.where and key else self.where or key

    def integer(self, key: str, default: int | None = None, *, minimum: int = 0) -> int:
        """Return an integer from `minimum` to 2^53; without a default the member is required."""
        value = self._get(key, default)
        if isinstance(value, float) and value.is_integer():
            # Store the integer in the document, because the writer of scene.glb uses it as an index.
            value = self.value[key] = int(value)
        if not isinstance(value, int) or isinstance(value, bool):
            self.fail(f"expected an integer, found {_show(value)}", key)
        if value < minimum:
            self.fail(f"expected an integer of at least {minimum}, found {value}", key)
        if value > 2**53:
            self.fail(f"the number {value} is too large", key)
        return value

    def index(self, key: str, count: int, what: str, default: int | None = None) -> int:
        """Return an index from 0 to `count` - 1; `what` is the plural of the indexed items, for messages."""
        value = self.integer(key, default)
        if value >= count:
            self.fail(f"{value} is out of range: the file has {count} {what}", key)
        return value

    def number(
        self, key: str, default: float | None = None, *, low: float = -math.inf, high: float = math.inf
    ) -> float:
        """Return a finite number between `low` and `high`."""
        value = self._number(self._get(key, default), key)
        if not low <= value <= high:
            expected = f"at least {low:g}" if math.isinf(high) else f"between {low:g} and {high:g}"
            self.fail(f"expected a number {expected}, found {value:g}", key)
        return value

    def numbers(self, key: str, count: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """Return `count` finite numbers."""
        value = self._get(key, default)
        if not isinstance(value, list | tuple) or len(value) != count:
            self.fail(f"expected {count} numbers, found {_show(value)}", key)
        return tuple(self._number(v, f"{key}[{i}]") for i, v in enumerate(value))

    def indices(self, key: str, count: int, what: str) -> list[int]:
        """Return a list of indices below `count`, empty if absent; for `what` see `index`."""
        value = self.value.get(key, [])
        if not isinstance(value, list):
            self.fail(f"expected a list of integers, found {_show(value)}", key)
        if all(type(v) is int and 0 <= v < count for v in value):
            return list(value)
        holder = JsonObject({f"{key}[{i}]": v for i, v in enumerate(value)}, self.where, self.file)
        return [holder.index(name, count, what) for name in holder.value]

    def string(self, key: str, default: str | None = None) -> str:
        """Return a string."""
        value = self._get(key, default)
        if not isinstance(value, str):
            self.fail(f"expected a string, found {_show(value)}", key)
        # Names are written to files, which cannot hold a lone surrogate.
        return without_surrogates(value) if key == "name" else value

    def strings(self, key: str) -> list[str]:
        """Return a list of strings (empty if absent)."""
        value = self.value.get(key, [])
        if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
            self.fail(f"expected a list of strings, found {_show(value)}", key)
        return value

    def boolean(self, key: str, default: bool) -> bool:
        """Return true or false."""
        value = self._get(key, default)
        if not isinstance(value, bool):
            self.fail(f"expected true or false, found {_show(value)}", key)
        return value

    def child(self, key: str) -> JsonObject:
        """Return the object under `key`, which is required."""
        value = self._get(key, None)
        if not isinstance(value, dict):
            self.fail(f"expected an object, found {_show(value)}", key)
        return JsonObject(value, self.path_of(key), self.file)

    def child_or_empty(self, key: str) -> JsonObject:
        """Return the object under `key`, or an empty one if it is absent."""
        return self.child(key) if key in self.value else JsonObject({}, self.path_of(key), self.file)

    def children(self, key: str) -> list[JsonObject]:
        """Return the list of objects under `key` (empty if absent); elements are not checked before use."""
        # Cache the list: importers call this for each of possibly thousands of accessors.
        if self._lists is None:
            self._lists = {}
        if key not in self._lists:
            self._lists[key] = list(self._children(key))
        return self._lists[key]

    def forget(self, key: str) -> None:
        """Drop the cached list under `key` after a change of the document."""
        if self._lists is not None:
            self._lists.pop(key, None)

    def _children(self, key: str) -> Iterator[JsonObject]:
        value = self.value.get(key, [])
        if not isinstance(value, list):
            self.fail(f"expected a list, found {_show(value)}", key)
        for i, item in enumerate(value):
            yield JsonObject(item, self.path_of(f"{key}[{i}]"), self.file)

    def extension(self, name: str) -> JsonObject | None:
        """Return this object's extension of that name, or None."""
        extensions = self.child_or_empty("extensions")
        return extensions.child(name) if name in extensions else None

    def _get(self, key: str, default: Any) -> Any:
        if key in self.value:
            return self.value[key]
        if default is None:
            self.fail(f"'{key}' is missing")
        return default

    def _number(self, value: Any, key: str) -> float:
        if not isinstance(value, int | float) or isinstance(value, bool):
            self.fail(f"expected a number, found {_show(value)}", key)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.fail("the number is not finite", key)
        return number


def _show(value: Any) -> str:
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}"
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."
