"""Reads `bake.json` of an output folder and validates it.

The numbers in a manifest are used as array sizes and indices, and its names as paths. Therefore a manifest is
first validated against the schema and checked for contradictions.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NoReturn

from baker.core.errors import InputError
from baker.core.printable import printable
from baker.io.bake.manifest import manifest_schema
from baker.io.bake.output_folder import MANIFEST_NAME, own_files
from baker.io.bake.recovery import recover
from baker.io.output_path import not_text
from baker.io.regular_file import read_regular

# Size above which a manifest is not read, bytes.
_LONGEST = 1 << 30
# Largest accepted width and height of a page, texels.
_WIDEST = 1 << 16
# Number of characters that a message shows from each end of a long text.
_SHORT = 60


def read_manifest(folder: Path) -> dict[str, Any]:
    """Undo incomplete writes of killed processes (`recover`), and return the manifest of an output folder.

    Parameters
    ----------
    folder : Path
        The output folder.

    Returns
    -------
    dict
        See `read_unrecovered`.

    Raises
    ------
    InputError
        If there is no such folder, it holds no bake, or the manifest is damaged.
    """
    recover(folder)
    return read_unrecovered(folder)


def read_unrecovered(folder: Path) -> dict[str, Any]:
    """Return the manifest of an output folder, and write nothing.

    Parameters
    ----------
    folder : Path
        The output folder.

    Returns
    -------
    dict
        The manifest, valid by the schema. Each channel has the pages 0 to n - 1, each once, and the page of
        every instance is one of them. All pages are squares of one size. No two instances have the same node,
        and no file is listed twice. Every file name is a path inside the folder. The numbers of instances,
        timings and rays are finite.

    Raises
    ------
    InputError
        If there is no such folder, it holds no bake, or the manifest is damaged.
    """
    if why := not_text(folder):
        raise InputError(f"{why}; rename it", file=str(folder))
    if not folder.exists():
        raise InputError("there is no such folder; name the output folder of a bake", file=str(folder))
    if folder.is_file():
        raise InputError("this is a file; name the output folder of a bake", file=str(folder))
    path = folder / MANIFEST_NAME
    if own_files(folder) is None or path.stat().st_size > _LONGEST:
        raise InputError(f"the folder holds no bake: it has no readable {MANIFEST_NAME}", file=str(folder))
    try:
        manifest: dict[str, Any] = json.loads(read_regular(path, most=_LONGEST), parse_constant=_no_number)
        _check_schema(manifest)
        _check_consistency(manifest)
    except (ValueError, OverflowError, RecursionError) as error:
        what = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"the manifest is damaged: {what}; bake the scene again", file=str(path)) from None
    return manifest


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number")


def _check_schema(manifest: dict[str, Any]) -> None:
    """Raise ValueError if the manifest violates the schema; the message names one violation."""
    # Import here, because importing `jsonschema` is slow and most runs read no manifest.
    from jsonschema import Draft202012Validator
    from jsonschema.exceptions import best_match

    error = best_match(Draft202012Validator(manifest_schema()).iter_errors(manifest))
    if error is not None:
        raise ValueError(f"{_where(error.absolute_path)}{_short(error.message)}")


def _where(path: Any) -> str:
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")
    return f"{_short(text)}: " if text else ""


def _short(text: str) -> str:
    text = printable(text)
    return text if len(text) <= 2 * _SHORT else f"{text[:_SHORT]} ... {text[-_SHORT:]}"


def _check_consistency(manifest: dict[str, Any]) -> None:
    """Raise ValueError if a manifest that is valid by the schema contradicts itself."""
    for key in ("instances", "timings", "rays"):
        _finite(manifest[key], key)
    by_channel: dict[str, list[int]] = {}
    sizes = set()
    for page in manifest["pages"]:
        by_channel.setdefault(page["channel"], []).append(page["page"])
        sizes.add((page["width"], page["height"]))
    if not by_channel:
        raise ValueError("it has no pages")
    numbers = list(by_channel.values())
    n_pages = len(numbers[0])
    if any(sorted(own) != list(range(n_pages)) for own in numbers):
        raise ValueError(f"the pages of each channel are not 0 to {n_pages - 1}, each once")
    if len(sizes) != 1 or (size := sizes.pop())[0] != size[1] or size[0] > _WIDEST:
        raise ValueError("its pages are not squares of one size")
    nodes = [row["node"] for row in manifest["instances"]]
    if len(set(nodes)) != len(nodes):
        raise ValueError("a node is named by two instances")
    for number, row in enumerate(manifest["instances"]):
        if row["page"] >= n_pages:
            raise ValueError(f"instances[{number}].page is {row['page']}, and there are {n_pages} pages")
    files = [entry["file"] for entry in manifest["files"]]
    if len(set(files)) != len(files):
        raise ValueError("a file is named twice")


def _finite(value: Any, where: str) -> None:
    """Raise ValueError if a number in nested lists and dicts is NaN, or 1e38 or larger in magnitude."""
    queue = [value]
    while queue:
        part = queue.pop()
        if isinstance(part, dict):
            queue.extend(part.values())
        elif isinstance(part, list):
            queue.extend(part)
        elif isinstance(part, float | int) and not abs(part) < 1e38:
            raise ValueError(f"a number in its {where} is not finite")
