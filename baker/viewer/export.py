"""Writes the viewer page with all its data as static files, which any web server can serve."""

from __future__ import annotations

import html
import json
import os
import shutil
from pathlib import Path, PurePath
from typing import Any

from baker.core.errors import ResourceError, SettingsError
from baker.core.version import VERSION
from baker.io.bake.mounts import cannot_move
from baker.io.bake.read_bake import StoredBake
from baker.io.bake.recovery import lies_inside
from baker.io.exchange import exchange_paths
from baker.io.output_path import resolved_output
from baker.io.regular_file import read_regular
from baker.io.temporary import TemporaryFolder, remove_abandoned
from baker.viewer.answers import POLICY, page_answers
from baker.viewer.script import ThreeScript

# Name of the file that lists the other files of an exported page. A folder is replaced only if it is empty,
# or if this list contains all its other files.
LIST_NAME = "files.json"
_CHARSET = '<meta charset="utf-8">'


def export_page(bake: StoredBake, three: ThreeScript, folder: Path) -> list[str]:
    """Write the viewer page of a bake into a folder, completely or not at all.

    The files contain no absolute path of this machine. Repeating an export gives the same bytes.

    Parameters
    ----------
    bake : StoredBake
        The bake that the page shows.
    three : ThreeScript
        The files of three.js that the page loads.
    folder : Path
        A new or empty folder, or a folder with an exported page. This page is replaced. Parents of the folder
        are created.

    Returns
    -------
    list of str
        The files, relative to `folder`.

    Raises
    ------
    InputError
        If the manifest names an unknown channel.
    SettingsError
        If `folder` is a file, contains a file that is not part of an exported page, or cannot be replaced.
    ResourceError
        If the files cannot be written; the folder is unchanged.
    """
    target = checked_folder(folder)
    try:
        remove_abandoned(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        home = TemporaryFolder(target)
        try:
            home.create()
            names = _write(bake, three, home.path / "new")
            _move(home.path, target)
        finally:
            home.remove()
    except OSError as error:
        message = f"the page cannot be written ({error.strerror}); free some space or name another folder"
        raise ResourceError(message, file=str(folder)) from None
    return names


def checked_folder(folder: Path) -> Path:
    """Return the absolute path of a folder that a page may be written to.

    Parameters
    ----------
    folder : Path
        The folder; it need not exist.

    Returns
    -------
    Path
        The path, without links.

    Raises
    ------
    SettingsError
        If the folder is a file or the root of the file system, contains a file that is not part of an
        exported page, or cannot be renamed.
    ResourceError
        If the folder cannot be read.
    """
    target = resolved_output(folder)
    if not target.name:
        raise SettingsError("this is the root of the file system; name a folder in it", file=str(folder))
    if not os.path.lexists(target):
        return target
    if not target.is_dir():
        raise SettingsError("this is a file; name a folder for the page", file=str(folder))
    try:
        foreign = _foreign_file(target)
    except OSError as error:
        raise ResourceError(f"the folder cannot be read ({error.strerror})", file=str(folder)) from None
    if foreign is not None:
        message = f"the folder holds '{foreign}', which is no file of an exported page; name another folder"
        raise SettingsError(message, file=str(folder))
    if cannot_move(target):
        why = "it is the current folder or a mount point, or its parent is read-only"
        message = f"the folder cannot be replaced as a whole ({why}); name a new folder in it"
        raise SettingsError(message, file=str(folder))
    return target


def _foreign_file(folder: Path) -> str | None:
    """Return the first file or link in a folder that is not part of an exported page, or None."""
    try:
        listed = json.loads(read_regular(folder / LIST_NAME))["files"]
        own = {LIST_NAME, *(name for name in listed if lies_inside(folder, name))}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        own = set()
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink() or (name not in own and not path.is_dir()):
            return name
    return None


def _write(bake: StoredBake, three: ThreeScript, folder: Path) -> list[str]:
    """Write all files into the new folder `folder`; return their names."""
    # Of the files of the bake, write only the maps, because the page links no others.
    linked = {f"out/{page['file']}" for page in bake.manifest["pages"]}
    names = []
    for address, (_, content) in page_answers(bake, three).items():
        if address.startswith("out/") and address not in linked:
            continue
        data = content()
        if address == "":
            address, data = "index.html", _with_policy(data)
        elif address == "scene.json":
            data = _without_paths(data)
        path = folder / address
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        names.append(address)
    _write_list(folder, names)
    return [*names, LIST_NAME]


def _with_policy(page: bytes) -> bytes:
    """Return the page with `POLICY` as a meta tag."""
    tag = f'<meta http-equiv="Content-Security-Policy" content="{html.escape(POLICY)}">'
    return page.decode().replace(_CHARSET, f"{_CHARSET}\n  {tag}", 1).encode()


def _without_paths(scene: bytes) -> bytes:
    """Return scene.json with names instead of paths of this machine, because others may see the page."""
    header: dict[str, Any] = json.loads(scene)
    for key in ("folder", "input"):
        header[key] = PurePath(header[key]).name
    return json.dumps(header, allow_nan=False).encode()


def _write_list(folder: Path, names: list[str]) -> None:
    text = json.dumps({"baker": VERSION, "files": sorted(names)}, indent=2)
    (folder / LIST_NAME).write_text(text + "\n", "utf-8", newline="\n")


def _move(home: Path, target: Path) -> None:
    """Move the folder `new` in `home` to `target`, and an old page from `target` to `home`."""
    new = home / "new"
    if not target.exists():
        new.rename(target)
        return
    shutil.copymode(target, new)
    if not exchange_paths(new, target):
        # The file system cannot exchange two folders, so `target` is missing for a moment.
        target.rename(home / "old")
        new.rename(target)
