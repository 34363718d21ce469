"""Opens picture files with Pillow, and converts errors about them."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from baker.core.encoding import check_size
from baker.core.errors import InputError
from baker.io.regular_file import read_regular

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

    Picture = TypeVar("Picture", bound=ImageFile)


@contextmanager
def open_picture(path: Path, reader: type[Picture], kind: str) -> Iterator[Picture]:
    """Yield a picture whose size is permitted.

    `PIL.Image.open` would warn about images above 89 million pixels and refuse those above 178 million, so
    the reader of the format is called instead.

    Parameters
    ----------
    path : Path
        The file.
    reader : type of `PIL.ImageFile.ImageFile`
        Pillow's class for the file format.
    kind : str
        Name of the file format, for messages.

    Yields
    ------
    PIL.ImageFile.ImageFile
        The picture; its pixels may not be decoded yet.

    Raises
    ------
    InputError
        If the file is missing, damaged or too large, or has another format.
    """
    from PIL.Image import DecompressionBombError

    try:
        with reader(io.BytesIO(read_regular(path))) as image:
            check_size(path, *image.size)
            yield image
    except FileNotFoundError:
        raise InputError("there is no such file", file=str(path)) from None
    except (OSError, SyntaxError, ValueError, EOFError, DecompressionBombError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"this is not a readable {kind} image ({reason})", file=str(path)) from None
