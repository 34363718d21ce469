"""Removes from outputs what may differ between two runs of one program: times, paths, versions."""

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
        # How long something took, and when.
        "timings", "created", "seconds", "compile_seconds", "startTimeUtc", "endTimeUtc",
        # What it was run with.
        "versions", "machine", "memory", "peak_memory", "source",
    }
)  # fmt: skip

# Replaced in texts, in this order.
REPLACED = (
    # Progress is shown every few seconds: how many lines, and what they say, depends on the machine.
    (re.compile(r"^[a-z][a-z ]*:  \d+ %.*\n", re.MULTILINE), ""),
    # Seconds, and how far they are indented.
    (re.compile(r"^\d+\.\d\d s: .*$", re.MULTILINE), lambda m: re.sub(r"\d+\.\d\d", "<time>", m[0])),
    (re.compile(r" *\b\d[\d.,]* (Mrays/s|s\b)"), r" <number> \1"),
    # The manifest's length follows the number of digits of its times.
    (re.compile(r"(bake\.json +)\d[\d.]* k?B"), r"\1<size>"),
    (re.compile(r"\b(time|timestamp)=\"[^\"]*\""), r'\1="<time>"'),
    (re.compile(r"127\.0\.0\.1:\d+"), "127.0.0.1:<port>"),
    (re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(Z|\+00:00)?"), "<date>"),
)
TEXTS = frozenset({".html", ".md", ".xml", ".svg", ".txt", ".toml", ".cfg", ".csv"})
# A longer text is kept as its hash alone.
LONGEST = 500_000

Entry = dict[str, Any]


def normal_text(text: str, places: dict[str, str]) -> str:
    """Return a text without times, ports and places of this machine.

    Parameters
    ----------
    text : str
    places : dict
        Absolute paths and their placeholders; the first match is used.
    """
    for path, name in places.items():
        text = text.replace(path, name)
    for pattern, by in REPLACED:
        text = pattern.sub(by, text)
    return text


def normal_json(value: Any, places: dict[str, str]) -> Any:
    """Return a JSON value without `REMOVED_KEYS`, and with normal texts; the order of keys is kept."""
    if isinstance(value, dict):
        return {key: normal_json(item, places) for key, item in value.items() if key not in REMOVED_KEYS}
    if isinstance(value, list):
        return [normal_json(item, places) for item in value]
    return normal_text(value, places) if isinstance(value, str) else value


def layout(text: str) -> str:
    """Name the way in which a JSON text is laid out: its spaces, line ends and escapes."""
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
    """Return what is recorded of a text, which may be JSON."""
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
    """Return what is recorded of a file."""
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
    """Return the JSON chunk of a GLB as text, and the hash of the rest: only to say what differs."""
    (length,) = struct.unpack_from("<I", content, 12)
    text, rest = content[20 : 20 + length].decode(), content[20 + length :]
    return {"rest": hashed(rest), **({"text": text.rstrip()} if length <= LONGEST else {})}
