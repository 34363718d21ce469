"""Removes from outputs all data that may differ between two runs of one program: times, paths, versions."""

from __future__ import annotations

import hashlib
import json
import re
import struct
from pathlib import Path
from typing import Any

# Keys removed from every JSON object, at any depth.
REMOVED_KEYS = frozenset(
    {
        # Durations and times of day.
        "timings", "created", "seconds", "compile_seconds", "startTimeUtc", "endTimeUtc",
        # Versions, machine and memory of the run.
        "versions", "machine", "memory", "peak_memory", "source",
    }
)  # fmt: skip

# (pattern, replacement), applied to texts in this order.
REPLACED = (
    # Progress lines are printed every few seconds, so their number and content depend on the machine.
    (re.compile(r"^[a-z][a-z ]*:  \d+ %.*\n", re.MULTILINE), ""),
    # Durations and rates. Spaces before them are replaced, too, because they depend on the number of digits.
    (re.compile(r"^\d+\.\d\d s: .*$", re.MULTILINE), lambda m: re.sub(r"\d+\.\d\d", "<time>", m[0])),
    (re.compile(r" *\b\d[\d.,]* (Mrays/s|s\b)"), r" <number> \1"),
    # The size of the manifest depends on the number of digits of its times.
    (re.compile(r"(bake\.json +)\d[\d.]* k?B"), r"\1<size>"),
    (re.compile(r"\b(time|timestamp)=\"[^\"]*\""), r'\1="<time>"'),
    (re.compile(r"127\.0\.0\.1:\d+"), "127.0.0.1:<port>"),
    (re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(Z|\+00:00)?"), "<date>"),
)
TEXTS = frozenset({".html", ".md", ".xml", ".svg", ".txt", ".toml", ".cfg", ".csv"})
# Longest text that is recorded, characters. Of a longer text, only the hash is recorded.
LONGEST = 500_000

Entry = dict[str, Any]


def normal_text(text: str, places: dict[str, str]) -> str:
    """Return a text in which times, ports and paths of this machine are replaced by placeholders.

    Parameters
    ----------
    text : str
    places : dict
        {absolute path: placeholder}, replaced in this order.
    """
    for path, name in places.items():
        text = text.replace(path, name)
    for pattern, by in REPLACED:
        text = pattern.sub(by, text)
    return text


def normal_json(value: Any, places: dict[str, str]) -> Any:
    """Return a JSON value without `REMOVED_KEYS`, in the same key order; strings become `normal_text`."""
    if isinstance(value, dict):
        return {key: normal_json(item, places) for key, item in value.items() if key not in REMOVED_KEYS}
    if isinstance(value, list):
        return [normal_json(item, places) for item in value]
    return normal_text(value, places) if isinstance(value, str) else value


def layout(text: str) -> str:
    """Return a description of the format of a JSON text: indentation, line ends and escapes."""
    value = json.loads(text)
    for indent in (None, 1, 2, 4):
        for separators in (None, (",", ":")):
            for escaped in (True, False):
                for end in ("", "\n"):
                    how = {"indent": indent, "separators": separators, "ensure_ascii": escaped}
                    if json.dumps(value, **how) + end == text:
                        return f"{how} {end!r}"
    return "other"


def hashed(content: bytes) -> str:
    """Return the SHA-256 of bytes, in hex."""
    return hashlib.sha256(content).hexdigest()


def text_entry(text: str, places: dict[str, str]) -> Entry:
    """Return the record entry of a text, parsed if it is JSON."""
    stripped = text.lstrip()
    if stripped[:1] in ("{", "["):
        try:
            value = json.loads(text)
        except ValueError:
            pass
        else:
            return _kept("json", json.dumps(normal_json(value, places)), layout=layout(text))
    return _kept("text", normal_text(text, places))


def file_entry(path: Path, places: dict[str, str]) -> Entry:
    """Return the record entry of a file."""
    content = path.read_bytes()
    suffix = path.suffix.lower()
    if suffix in TEXTS or content[:1] in (b"{", b"["):
        try:
            return text_entry(content.decode(), places)
        except UnicodeDecodeError:
            pass
    entry: Entry = {"kind": "bytes", "sha256": hashed(content)}
    if content[:4] == b"glTF":
        entry |= _glb_parts(content)
    return entry


def _kept(kind: str, text: str, **more: Any) -> Entry:
    entry: Entry = {"kind": kind, "sha256": hashed(text.encode()), **more}
    if len(text) <= LONGEST:
        entry["text"] = text
    return entry


def _glb_parts(content: bytes) -> Entry:
    """Return an entry with the JSON chunk of a GLB as text and the hash of the other bytes."""
    (length,) = struct.unpack_from("<I", content, 12)
    text, rest = content[20 : 20 + length].decode(), content[20 + length :]
    return {"rest": hashed(rest), **({"text": text.rstrip()} if length <= LONGEST else {})}
