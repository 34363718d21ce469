"""Writes a finished bake to its folder: maps, status images, `scene.glb`, exports and `bake.json`."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from baker.core.encoding import ALWAYS_WRITTEN, ENCODINGS, Encoding, Loss, measure_loss
from baker.core.errors import ResourceError, SettingsError
from baker.core.export import EXPORTS
from baker.core.lightmap import BakeResult, ChannelDescription, Lightmap, TexelStatus
from baker.core.progress import Progress, report, silent
from baker.core.scene import SceneWarning
from baker.core.stage import Stage
from baker.core.version import VERSION
from baker.io.bake.manifest import make_manifest, manifest_text
from baker.io.bake.output_folder import MANIFEST_NAME, OutputFolder, check_out
from baker.io.gltf.write_baked import make_glb
from baker.io.png import encode_palette_png, encode_png, grey_levels

__all__ = ["check_out", "write_bake"]

# Palette colours of `status_<page>.png`, 8-bit sRGB. COVERED and INVALID differ in hue only, the others
# also in luminance. All remain distinguishable with red-green colour blindness.
STATUS_COLOURS = {
    TexelStatus.EMPTY: (16, 16, 16),
    TexelStatus.COVERED: (86, 180, 233),
    TexelStatus.DILATED: (0, 80, 130),
    TexelStatus.INVALID: (230, 159, 0),
    TexelStatus.UNCONVERGED: (240, 228, 66),
}

# Largest share of banded texels (see `baker.core.encoding.Loss`) among all texels of a page that are not
# empty, 0 to 1. Above this share, there is a warning.
BANDED_SHARE = 0.01


def write_bake(
    result: BakeResult,
    out: Path,
    *,
    force: bool = False,
    progress: Progress = silent,
    created: datetime | None = None,
) -> dict[str, Any]:
    """Write a bake to a folder, completely or not at all.

    Parameters
    ----------
    result : BakeResult
        The bake.
    out : Path
        The output folder. A bake there is replaced. Other files are kept, unless a new file has the same
        name.
    force : bool
        Also write into a folder that contains files but no bake.
    progress : Progress
        Called with stage, fraction done and a text: the name of the file, after each page, each status image
        and `scene.glb`; "export" and its name, before each export. A truthy return value cancels.
    created : datetime or None
        Time to write into the manifest; None uses the current time.

    Returns
    -------
    dict
        The manifest, as in `bake.json`.

    Raises
    ------
    SettingsError
        If `check_out` refuses `out`, or if a name of an encoding or export is unknown.
    ResourceError
        If the disk is full or not writable; the folder is unchanged. If `scene.glb` would be too large.
    Cancelled
        If `progress` returned a truthy value; the folder is unchanged.
    """
    check_out(out, force=force, scene_path=result.scene.path)
    try:
        with OutputFolder(out) as folder:
            manifest = _write_files(result, folder, progress, created)
            folder.commit()
    except OSError as error:
        why = error.strerror or str(error)
        message = f"the bake cannot be written ({why}); free some space or name another folder"
        raise ResourceError(message, file=str(out)) from error
    except ResourceError as error:
        # Name the output folder in the message, because the temporary file that the error names is removed.
        raise ResourceError(error.message, file=str(out)) from error
    return manifest


def _write_files(
    result: BakeResult, folder: OutputFolder, progress: Progress, created: datetime | None
) -> dict[str, Any]:
    n_pages = result.atlas.n_pages
    steps = n_pages * (len(result.lightmaps) + 1) + 1
    pages: list[dict[str, Any]] = []
    files: list[dict[str, Any]] = []
    warnings: list[SceneWarning] = []
    for lightmap in result.lightmaps.values():
        for page in range(len(lightmap.value)):
            entry, found = _write_page(result, lightmap, page, folder.path)
            warnings += found
            pages.append(entry)
            files += [{"file": e["file"], "sha256": e["sha256"]} for e in (entry, *entry["encodings"])]
            report(progress, Stage.WRITE, len(pages) / steps, entry["file"])
    for page in range(n_pages):
        legend = ", ".join(f"{status.value} {status.name.lower()}" for status in TexelStatus)
        colours = {status.value: colour for status, colour in STATUS_COLOURS.items()}
        data = encode_palette_png(result.status[page], colours, {"Legend": legend, "Software": _signature()})
        files.append(_write_data(folder.path, f"status_{page}.png", data))
        report(progress, Stage.WRITE, (len(pages) + page + 1) / steps, files[-1]["file"])
    ao = result.lightmaps.get("ao")
    ao_png = {p: encode_png(grey_levels(ao.value[p, :, :, 0])) for p in range(len(ao.value))} if ao else None
    glb = make_glb(result.scene, result.atlas, ao_png)
    files.append(_write_data(folder.path, "scene.glb", glb.data))
    report(progress, Stage.WRITE, 1.0, "scene.glb")
    manifest = make_manifest(
        result,
        folder.out,
        pages=pages,
        files=files,
        instance_mesh=glb.instance_mesh,
        warnings=tuple(warnings),
        created=created,
    )
    _write_manifest(folder.path, manifest)
    # Write exports last, because exporters read the other files from the folder.
    for name in result.settings.export:
        report(progress, Stage.WRITE, 1.0, f"export {name}")
        manifest["files"] += _write_export(folder.path, name)
    if result.settings.export:
        _write_manifest(folder.path, manifest)
    return manifest


def _write_manifest(folder: Path, manifest: dict[str, Any]) -> None:
    (folder / MANIFEST_NAME).write_text(manifest_text(manifest), "utf-8", newline="\n")


def _write_export(folder: Path, name: str) -> list[dict[str, Any]]:
    """Write an export into the subfolder `name`; return an entry {file, sha256} for each of its files."""
    export = EXPORTS.require(name, "export", setting="export")
    target = folder / name
    target.mkdir()
    export.write(folder, target)
    found = []
    for path in sorted(p for p in target.rglob("*") if p.is_file()):
        with path.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        found.append({"file": path.relative_to(folder).as_posix(), "sha256": digest})
    return found


def _write_page(
    result: BakeResult, lightmap: Lightmap, page: int, folder: Path
) -> tuple[dict[str, Any], list[SceneWarning]]:
    """Write one page of a channel as EXR and in each chosen format that can store the channel.

    Return the manifest entry of the page, and the warnings about losses.
    """
    value, described = lightmap.value[page], lightmap.description
    height, width, _ = value.shape
    header = {
        "quantity": described.quantity,
        "unit": described.unit,
        "colourSpace": described.colour_space,
        "software": _signature(),
    }
    settings = result.settings
    surface = result.status[page] != TexelStatus.EMPTY
    entries: list[dict[str, Any]] = []
    warnings: list[SceneWarning] = []
    for name in (ALWAYS_WRITTEN, *settings.encode):
        encoding = encoding_named(name)
        if why_unfit(name, described) is not None:
            continue
        options = encoding.fitted(encoding.options_of(settings), float(lightmap.value.max(initial=0.0)))
        file = f"{lightmap.channel}_{page}{encoding.suffix}"
        encoding.encode(folder / file, value, options=options, header=header, names=described.components)
        with (folder / file).open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        loss = measure_loss(encoding, value, surface, options)
        warnings += _loss_warnings(loss, file, lightmap.channel, encoding)
        low, high = encoding.limits(options)
        entry: dict[str, Any] = {"encoding": name, "file": file, "sha256": digest}
        entries.append({**entry, "min": low, "max": high, "clipped": loss.clipped, "banded": loss.banded})
    exr, *others = entries
    page_entry: dict[str, Any] = {"channel": lightmap.channel, "page": page, **exr}
    for key in ("encoding", "min", "max"):
        del page_entry[key]
    page_entry |= {"width": width, "height": height, "unit": described.unit}
    page_entry |= {
        "quantity": described.quantity,
        "colour_space": described.colour_space,
        "encodings": others,
    }
    return page_entry, warnings


def encoding_named(name: str) -> Encoding[Any]:
    """Return an encoding by its name, EXR included.

    Parameters
    ----------
    name : str
        Name of the encoding.

    Returns
    -------
    Encoding
        The plugin.

    Raises
    ------
    SettingsError
        If no encoding has this name.
    """
    # Leave EXR out of the names that the message lists, because `encode` does not accept it.
    return ENCODINGS.require(name, "encoding", setting="encode", hidden=(ALWAYS_WRITTEN,))


def why_unfit(name: str, channel: ChannelDescription) -> str | None:
    """Return why an encoding cannot store a channel, such as "holds no negative numbers"; None if it can."""
    encoding = ENCODINGS.require(name, "encoding")
    n = len(channel.components)
    if n not in encoding.components:
        held = sorted(encoding.components)
        number = "one" if held == [1] else "three" if held == [3] else f"{held[0]} to {held[-1]}"
        return f"holds maps of {number} component(s), not of {n}"
    if channel.signed and not encoding.signed:
        return "holds no negative numbers"
    return None


def check_encodings(
    names: tuple[str, ...], channels: Mapping[str, ChannelDescription], resolution: int = 0
) -> None:
    """Check before a bake that each encoding can hold at least one of the channels, and pages of this size.

    Parameters
    ----------
    names : tuple of str
        Names of encodings.
    channels : mapping of str to ChannelDescription
        The channels of the bake, by name.
    resolution : int
        Width and height of the pages, texels; 0 skips the check of the size.

    Raises
    ------
    SettingsError
        If an encoding is unknown, is EXR, can hold none of the channels, or cannot hold pages of this size.
    """
    for name in names:
        largest = encoding_named(name).largest
        if name == ALWAYS_WRITTEN:
            raise SettingsError("exr is written in any case; name further formats only", object="encode")
        if resolution > largest:
            message = (
                f"'{name}' holds at most {largest} x {largest} texels; lower `resolution` or use the EXR"
            )
            raise SettingsError(message, object="encode")
        reasons = {channel: why_unfit(name, described) for channel, described in channels.items()}
        if None not in reasons.values():
            why = "; ".join(f"{channel}: {reason}" for channel, reason in reasons.items())
            message = f"'{name}' can hold none of the channels that are baked ({why}); use the EXR"
            raise SettingsError(message, object="encode")


def _loss_warnings(loss: Loss, file: str, channel: str, encoding: Encoding[Any]) -> list[SceneWarning]:
    """Return a warning about clipped texels, and one if the banded share exceeds `BANDED_SHARE`."""
    warnings = []
    if loss.clipped:
        message = f"{file}: {loss.clipped} texels are outside the range of the format and were clipped"
        warnings.append(SceneWarning("clipped", f"{message}; {encoding.when_clipped}", channel))
    if loss.banded > BANDED_SHARE * loss.surface:
        share = 100.0 * loss.banded / loss.surface
        message = f"{file}: steps of the format show in {share:.1f} % of the texels"
        warnings.append(SceneWarning("banding", f"{message}; {encoding.when_banded}", channel))
    return warnings


def _write_data(folder: Path, name: str, data: bytes) -> dict[str, Any]:
    (folder / name).write_bytes(data)
    return {"file": name, "sha256": hashlib.sha256(data).hexdigest()}


def _signature() -> str:
    return f"baker {VERSION}"
