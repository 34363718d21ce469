"""Finds ambiguous HTTP requests, that is, requests that two programs could interpret differently.

Browsers do not send such requests. An attacker may send them to pass the server's check of the host name.

Based on: RFC 9112, HTTP/1.1, sections 2.2, 3.2, 5.1, 5.2 and 6.3.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from urllib.parse import urlsplit

_REQUEST_LINE = re.compile(rb"[A-Z]+ ([!-~]+) HTTP/1\.[01]\r\n")
# A header line: a name, a colon directly after it, and a value without control characters except tabs.
_FIELD = re.compile(rb"([!#$%&'*+.^_`|~0-9A-Za-z-]+):[ \t]*([^\x00-\x08\x0a-\x1f\x7f]*?)[ \t]*\r\n")


def fault_of_request(request_line: bytes, fields: Sequence[bytes], names: Collection[str]) -> str | None:
    """Return the reason if a request is ambiguous, names another server or has a body, else None.

    Parameters
    ----------
    request_line : bytes
        The first line of the request, with its line end.
    fields : sequence of bytes
        The lines of the request's header as received, without the empty line at the end.
    names : collection of str
        The host names of this server, each with the port.

    Returns
    -------
    str or None
        A short text for the response, or None.
    """
    line = _REQUEST_LINE.fullmatch(request_line)
    if line is None:
        return "malformed request line"
    found: dict[str, list[str]] = {}
    for field in fields:
        match = _FIELD.fullmatch(field)
        if match is None:
            return "malformed header line"
        found.setdefault(match[1].decode().lower(), []).append(match[2].decode("latin-1"))
    hosts = found.get("host", [])
    if len(hosts) != 1:
        return "not exactly one Host header"
    if "transfer-encoding" in found or any(length != "0" for length in found.get("content-length", [])):
        return "a body is not expected"
    return _fault_of_target(line[1].decode(), hosts[0], names)


def _fault_of_target(target: str, host: str, names: Collection[str]) -> str | None:
    """Return the reason if a request target is not a path on `host`, else None."""
    if target.startswith("/"):
        return "an empty host in the path" if target.startswith("//") else None
    try:
        parts = urlsplit(target)
    except ValueError:
        return "malformed target"
    if parts.scheme != "http" or parts.netloc not in names or parts.netloc != host:
        return "a target on another host"
    return None
