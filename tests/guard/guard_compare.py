"""Describes the differences between two records of the guard (see `outputs.py`), one line for each."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterator
from typing import Any

# Largest number of differences that are reported for one file.
MOST = 8
_NOTHING = object()

Record = dict[str, Any]


def compare(old: Record, new: Record) -> list[str]:
    """Return a line for each difference; empty if the records are equal."""
    if old["format"] != new["format"]:
        return ["the records are of different formats: record both again"]
    found: list[str] = []
    for name in dict.fromkeys([*old["runs"], *new["runs"]]):
        if name not in old["runs"] or name not in new["runs"]:
            found.append(f"{name}: only in the {'new' if name in new['runs'] else 'old'} record")
            continue
        found += [f"{name}: {line}" for line in _run(old["runs"][name], new["runs"][name])]
    return found


def _run(old: Record, new: Record) -> Iterator[str]:
    before, after = ([step["command"] for step in run["steps"]] for run in (old, new))
    if before != after:
        yield "its command lines differ: record both with the same version of the guard"
        return
    for a, b in zip(old["steps"], new["steps"], strict=True):
        if a.get("exit") != b.get("exit"):
            yield f"`{a['command']}`: exit code {a.get('exit')} -> {b.get('exit')}"
        for stream in ("stdout", "stderr"):
            for line in _entry(a.get(stream), b.get(stream)):
                yield f"`{a['command']}`: {stream}{line}"
    for name in sorted({*old["files"], *new["files"]}):
        for line in _entry(old["files"].get(name), new["files"].get(name)):
            yield f"{name}{line}"
    if old["left"] != new["left"]:
        yield f"temporary files left: {old['left']} -> {new['left']}"


def _entry(old: Record | None, new: Record | None) -> list[str]:
    """Return lines that describe the differences between two entries of one file or output stream."""
    if old == new:
        return []
    if old is None or new is None:
        return [" is new"] if old is None else [" is missing"]
    if old["kind"] != new["kind"]:
        return [f" was {old['kind']}, is {new['kind']}"]
    lines: list[str] = []
    if old.get("layout") != new.get("layout"):
        lines.append(f": laid out as {old.get('layout')} -> {new.get('layout')}")
    a, b = old.get("text"), new.get("text")
    if a is not None and b is not None and a != b:
        lines += _json(a, b) if a[:1] in ("{", "[") and b[:1] in ("{", "[") else _lines(a, b)
    if old.get("rest") != new.get("rest"):
        lines.append(": its binary chunk differs")
    if not lines:
        lines.append(f": {old['kind']} differ")
    more = len(lines) - MOST
    return lines[:MOST] + ([f": and {more} more differences"] if more > 0 else [])


def _lines(old: str, new: str) -> list[str]:
    changes = difflib.unified_diff(old.splitlines(), new.splitlines(), lineterm="", n=0)
    found = [f": {line}" for line in changes if not line.startswith(("---", "+++", "@@"))]
    return found or [": line ends differ"]


def _json(old: str, new: str) -> list[str]:
    try:
        a, b = json.loads(old), json.loads(new)
    except ValueError:
        return _lines(old, new)
    return [f": {line}" for line in json_differences(a, b)] or [": spaces or number formats differ"]


def json_differences(old: Any, new: Any, path: str = "$") -> Iterator[str]:
    """Yield a line for each path at which two JSON values differ; the order of keys is compared, too."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*old, *new]):
            yield from json_differences(old.get(key, _NOTHING), new.get(key, _NOTHING), f"{path}.{key}")
        if old.keys() == new.keys() and list(old) != list(new):
            yield f"{path}: keys in another order"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from json_differences(a, b, f"{path}[{number}]")
    elif type(old) is not type(new) or old != new:
        yield f"{path}: {_short(old)} -> {_short(new)}"


def _short(value: Any) -> str:
    if value is _NOTHING:
        return "nothing"
    if isinstance(value, list):
        return f"{len(value)} items"
    text = json.dumps(value)
    return text if len(text) <= 100 else text[:97] + "..."
