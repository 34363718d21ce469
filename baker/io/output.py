"""Writes a finished bake to its folder: maps, status, scene, manifest."""

from __future__ import annotations

import hashlib
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from baker.core.encoding import ENCODINGS
from baker.core.errors import ResourceError
from baker.core.lightmap import BakeResult, Lightmap, TexelStatus
from baker.core.progress import Progress, report, silent
from baker.io.gltf_write import make_glb
from baker.io.manifest import make_manifest, manifest_text
from baker.io.output_folder import MANIFEST_NAME, OutputFolder, check_out, remove_leftovers
from baker.io.png import encode_palette_png, encode_png, grey_levels

__all__ = ["OutputFolder", "check_out", "remove_leftovers", "write_bake"]

# Colours told apart in grey and by eyes that mix red and green.
STATUS_COLOURS = {
    TexelStatus.EMPTY: (16, 16, 16),
    TexelStatus.COVERED: (86, 180, 233),
    TexelStatus.DILATED: (0, 80, 130),
    TexelStatus.INVALID: (230, 159, 0),
    TexelStatus.UNCONVERGED: (240, 228, 66),
}

_QUANTITY = {
    "irradiance": "irradiance E on the surface, direct and indirect, without the receiver's albedo",
    "ao": "ambient occlusion: cosine-weighted open share of the hemisphere, 1 = open",
}


def write_bake(
    result: BakeResult,
    out: Path,
    *,
    force: bool = False,
    progress: Progress = silent,
    created: datetime | None = None,
    open_folders: list[OutputFolder] | None = None,
) -> dict[str, Any]:
    """Write a bake to `out`, all of it or nothing.

    Parameters
    ----------
    result : BakeResult
    out : Path
        The output folder. A bake there is replaced; files that baker did not write are kept.
    force : bool
        Also write into a folder that is not a bake.
    progress : Progress
        Is told of each file; may cancel.
    created : datetime or None
        Time to write into the manifest; None is now.
    open_folders : list of OutputFolder or None
        The folder at work is appended here while it is open, so that a program that has to stop at once can
        call `abort` on it.

    Returns
    -------
    dict
        The manifest, as in `bake.json`.

    Raises
    ------
    SettingsError
        If `out` is not a place to write to, see `check_out`.
    ResourceError
        If the disk is full or not writable; the folder is then as it was.
    Cancelled
        If `progress` says so; the folder is then as it was.
    """
    check_out(out, force=force, scene_path=result.scene.path)
    folder = OutputFolder(out)
    if open_folders is not None:
        open_folders.append(folder)
    try:
        with folder:
            manifest = _write_files(result, folder, progress, created)
            folder.commit()
    except OSError as error:
        why = error.strerror or str(error)
        message = f"the bake cannot be written ({why}); free some space or name another folder"
        raise ResourceError(message, file=str(out)) from error
    except ResourceError as error:
        # The file named by the error lay in the temporary folder, which is gone.
        raise ResourceError(error.message, file=str(out)) from error
    finally:
        if open_folders is not None:
            open_folders.remove(folder)
    return manifest


def _write_files(
    result: BakeResult, folder: OutputFolder, progress: Progress, created: datetime | None
) -> dict[str, Any]:
    n_pages = result.atlas.n_pages
    steps = n_pages * (len(result.lightmaps) + 1) + 1
    pages: list[dict[str, Any]] = []
    files: list[dict[str, Any]] = []
    clipped: dict[str, int] = {}
    for channel, lightmap in result.lightmaps.items():
        clipped[channel] = 0
        for page in range(len(lightmap.value)):
            entry, count = _write_page(result, lightmap, page, folder.path)
            clipped[channel] += count
            pages.append(entry)
            files.append({"file": entry["file"], "sha256": entry["sha256"]})
            report(progress, "write", len(files) / steps, entry["file"])
    for page in range(n_pages):
        legend = ", ".join(f"{status.value} {status.name.lower()}" for status in TexelStatus)
        colours = {status.value: colour for status, colour in STATUS_COLOURS.items()}
        data = encode_palette_png(result.status[page], colours, {"Legend": legend, "Software": _signature()})
        files.append(_write_data(folder.path, f"status_{page}.png", data))
        report(progress, "write", len(files) / steps, files[-1]["file"])
    ao = result.lightmaps.get("ao")
    ao_png = {p: encode_png(grey_levels(ao.value[p, :, :, 0])) for p in range(len(ao.value))} if ao else None
    glb = make_glb(result.scene, result.atlas, ao_png)
    files.append(_write_data(folder.path, "scene.glb", glb.data))
    report(progress, "write", 1.0, "scene.glb")
    manifest = make_manifest(
        result,
        folder.out,
        pages=pages,
        files=files,
        instance_mesh=glb.instance_mesh,
        clipped=clipped,
        created=created,
    )
    (folder.path / MANIFEST_NAME).write_text(manifest_text(manifest), "utf-8", newline="\n")
    return manifest


def _write_page(
    result: BakeResult, lightmap: Lightmap, page: int, folder: Path
) -> tuple[dict[str, Any], int]:
    """Write one page of a channel; return its manifest entry and the texels that were clipped."""
    encoding = ENCODINGS.get("exr")
    if encoding is None:
        raise ResourceError("the EXR encoding is missing from this installation; install baker again")
    name = f"{lightmap.channel}_{page}{encoding.suffix}"
    value = lightmap.value[page]
    quantity = _QUANTITY.get(lightmap.channel, lightmap.channel)
    colour_space = "linear Rec.709, D65" if value.shape[2] == 3 else "none"
    header = {
        "quantity": quantity,
        "unit": lightmap.unit,
        "colourSpace": colour_space,
        "software": _signature(),
    }
    count = encoding.encode(folder / name, value, half=result.settings.dtype == "half", header=header)
    with (folder / name).open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    height, width = value.shape[:2]
    entry: dict[str, Any] = {"channel": lightmap.channel, "page": page, "file": name, "sha256": digest}
    entry |= {"width": width, "height": height, "unit": lightmap.unit}
    return {**entry, "quantity": quantity, "colour_space": colour_space}, count


def _write_data(folder: Path, name: str, data: bytes) -> dict[str, Any]:
    (folder / name).write_bytes(data)
    return {"file": name, "sha256": hashlib.sha256(data).hexdigest()}


def _signature() -> str:
    return f"baker {version('baker')}"
