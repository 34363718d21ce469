"""`baker render SCENE -o IMAGE`: renders a scene with the reference path tracer and a pinhole camera."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from baker.cli.command import Run, command
from baker.core.printable import printable
from baker.io.formats import scene_file_help
from baker.rendering.settings import RenderSettings

if TYPE_CHECKING:
    from baker.rendering.render import Picture


@command("render", RenderSettings)
def render(
    ctx: typer.Context,
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help=scene_file_help())],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="IMAGE", help="EXR or PNG file to write.")],
) -> None:
    """Render a scene, and report the image written."""
    run: Run = ctx.obj
    settings = run.of(RenderSettings)
    with run.progress() as progress:
        from baker.rendering.render import render
        from baker.rendering.write import check_image, write_picture

        check_image(out, settings.aov)
        run.session.will_write(str(out))
        picture = render(scene, settings, progress)
        write_picture(out, picture)
    if not run.quiet:
        write_text(picture, out, settings, run.text)
    if run.as_json:
        run.session.write_json(picture_json(picture, out, settings))


def write_text(picture: Picture, out: Path, settings: RenderSettings, stream: TextIO) -> None:
    """Write warnings, the size of the image, the number of rays per second, and the tone mapping of a PNG."""
    from baker.rendering.write import tone_of

    for warning in picture.warnings:
        where = f"{printable(warning.object)}: " if warning.object else ""
        stream.write(f"warning: {where}{warning.message} [{warning.code}]\n")
    rate = picture.rays / max(picture.seconds, 1e-9) / 1e6
    stream.write(
        f"{out}: {settings.width} x {settings.height}, {picture.spp} samples a pixel,"
        f" {picture.seconds:.1f} s, {rate:.1f} Mrays/s\n"
    )
    tone = tone_of(out, picture)
    if tone is not None:
        stream.write(f"tone mapping: {tone}\n")


def picture_json(picture: Picture, out: Path, settings: RenderSettings) -> dict[str, Any]:
    """Return the JSON object of `render --json`."""
    from baker.rendering.write import exr_layers, tone_of

    tone = tone_of(out, picture)
    return {
        "out": str(out),
        **picture.to_dict(),
        "tone": tone,
        "layers": list(exr_layers(picture)) if tone is None else [],
        "estimator": None if settings.ao or settings.lightmap else settings.estimator,
        "denoised": settings.denoise,
    }
