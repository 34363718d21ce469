"""Reads the data of a URI in a glTF file: embedded in the URI, or in a file beside the scene.

Based on: RFC 2397 (data URIs), RFC 3986 (percent-encoding); glTF 2.0 Specification, section 2.8.
"""

from __future__ import annotations

import base64
import binascii
from urllib.parse import unquote, unquote_to_bytes

from baker.io.scene_folder import OutsideName, SceneFolder

# Number of characters of a URI that a message shows.
_LONGEST = 80
_URL_SAFE = bytes.maketrans(b"-_", b"+/")


class UriError(Exception):
    """The data of a URI cannot be read; the message is the reason."""


def is_data(uri: str) -> bool:
    """Return whether a URI contains the data.

    Parameters
    ----------
    uri : str
        The URI.

    Returns
    -------
    bool
        Whether it is a data URI.
    """
    return uri[:5].lower() == "data:"


def read_uri(uri: str, folder: SceneFolder, *, first: int | None = None) -> bytes:
    """Return the data of a URI.

    Parameters
    ----------
    uri : str
        A data URI of any media type, or the relative name of a file. Names with bare percent signs or
        backslashes are accepted although they are no valid URIs.
    folder : SceneFolder
        Folder that relative names refer to.
    first : int, optional
        Read at most this number of bytes, from the start of a file.

    Returns
    -------
    bytes
        The data.

    Raises
    ------
    UriError
        If there is no such file, it cannot be read, the data URI is malformed, or the URI is a web address.
    OutsideName
        If none of the file names that the URI may stand for exists inside the scene's folder, and one of them
        is outside.
    """
    if is_data(uri):
        return _decode_data(uri)
    scheme, colon, _ = uri.partition("://")
    if colon and scheme.isalnum():
        raise UriError(f"'{uri[:_LONGEST]}' is not a file beside the scene; store it there")
    outside: OutsideName | None = None
    for name in file_names(uri):
        try:
            return folder.read(name, first=first)
        except FileNotFoundError:
            continue
        except OutsideName as error:
            outside = OutsideName(f"the file '{uri[:_LONGEST]}' {error}")
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            raise UriError(f"the file '{uri[:_LONGEST]}' cannot be read: {why}") from None
    if outside is not None:
        raise outside
    raise UriError(f"the file '{uri[:_LONGEST]}' is missing; put it beside the scene")


def file_names(uri: str) -> list[str]:
    """Return the file names that a URI may refer to, the most likely first."""
    # Try the undecoded name as well, because some exporters do not encode % signs.
    names = [unquote(uri), uri]
    return list(dict.fromkeys([*names, *(name.replace("\\", "/") for name in names)]))


def _decode_data(uri: str) -> bytes:
    head, comma, body = uri.partition(",")
    if not comma:
        raise UriError("the data URI has no comma before its data")
    if not head.lower().rstrip().endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        data = (unquote(body) if "%" in body else body).encode("ascii").translate(_URL_SAFE, b" \t\r\n\f")
        # Accept missing padding, as browsers do.
        return base64.b64decode(data.rstrip(b"=") + b"=" * (-len(data.rstrip(b"=")) % 4), validate=True)
    except (binascii.Error, ValueError) as error:
        raise UriError(f"the data URI is not valid base64 ({error})") from None
