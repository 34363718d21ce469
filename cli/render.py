"""`baker render SCENE -o IMAGE`: the reference path tracer through a pinhole camera."""

from __future__ import annotations

import inspect
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baker.cli.commands import COMMANDS
from baker.cli.options import build, common_flags, flag, given, setting_flags

if TYPE_CHECKING:
    from baker.cli.session import Session


def command() -> Any:
    """Return the subcommand."""
    keyword = inspect.Parameter.KEYWORD_ONLY
    scene = Annotated[Path, typer.Argument(metavar="SCENE", help="glb, gltf, obj, ply, stl or off file.")]
    image = Annotated[Path, typer.Option("--out", "-o", metavar="IMAGE", help="EXR or PNG file to write.")]
    flags = [
        inspect.Parameter("ctx", keyword, annotation=typer.Context),
        inspect.Parameter("scene", keyword, annotation=scene),
        inspect.Parameter("out", keyword, annotation=image),
        _text(
            "camera",
            "PX,PY,PZ,TX,TY,TZ,FOV|NAME|NUMBER",
            "Position, target, vertical field of view in degrees; or one of the file's own.",
        ),
        flag("width", int, typer.Option("--width", metavar="N", help="Pixels."), 640),
        flag("height", int, typer.Option("--height", metavar="N", help="Pixels."), 480),
        flag(
            "spp", int | None, typer.Option("--spp", metavar="N", help="Paths for each pixel (default 64).")
        ),
        flag(
            "time_limit",
            float | None,
            typer.Option("--time-limit", metavar="SECONDS", help="Stop after this time."),
        ),
        flag(
            "estimator",
            str,
            typer.Option(
                "--estimator",
                metavar="NAME",
                help="uniform, cosine, stratified, light, bsdf, mis, mis-power, bdpt.",
            ),
            "mis",
        ),
        flag(
            "max_depth",
            int | None,
            typer.Option("--max-depth", metavar="N", help="Longest path; 1 is direct light only."),
        ),
        flag("ao", bool, typer.Option("--ao", help="Render ambient occlusion."), False),
        _text("aov", "NAME,...", "Further layers: albedo, normal, depth."),
        flag(
            "denoise", bool, typer.Option("--denoise", help="Run Open Image Denoise over the picture."), False
        ),
        flag(
            "lightmap",
            Path | None,
            typer.Option("--lightmap", metavar="OUT", help="Light the scene by this bake instead."),
        ),
        *setting_flags(only={"sky", "sky_strength", "ao_distance", "threads", "seed"}),
        *common_flags(),
    ]
    return build("render", COMMANDS["render"], work, flags)


def _text(name: str, metavar: str, words: str) -> inspect.Parameter:
    option = typer.Option(f"--{name}", metavar=metavar, help=words, show_default=False)
    return flag(name, str | None, option)


def work(
    *,
    ctx: typer.Context,
    scene: Path,
    out: Path,
    camera: str | None,
    width: int,
    height: int,
    spp: int | None,
    time_limit: float | None,
    estimator: str,
    max_depth: int | None,
    ao: bool,
    aov: str | None,
    denoise: bool,
    lightmap: Path | None,
    as_json: bool,
    quiet: bool,
    verbose: int,
    **settings: Any,
) -> None:
    """Render, and tell what was made."""
    from baker.cli.config import resolve

    session: Session = ctx.obj
    as_json = as_json or session.as_json
    chosen = given(settings)
    resolved = resolve(chosen, None)
    with session.reporter(quiet=quiet) as progress:
        progress("start", 0.0)
        from baker.rendering import RenderSettings, check_image, render, write_picture
        from baker.rendering.write import exr_layers, tone_of

        layers = tuple(name.strip() for name in aov.split(",")) if aov else ()
        wanted = RenderSettings(
            camera=camera,
            width=width,
            height=height,
            spp=spp,
            time_limit=time_limit,
            estimator=estimator,
            max_depth=max_depth,
            ao=ao,
            ao_distance=chosen.get("ao_distance"),
            aov=layers,
            denoise=denoise,
            lightmap=lightmap,
            sky=chosen.get("sky"),
            sky_strength=resolved.sky_strength,
            seed=resolved.seed,
            threads=resolved.threads,
        )
        check_image(out, layers)
        session.will_write(str(out))
        picture = render(scene, wanted, progress)
        write_picture(out, picture)
    rate = picture.rays / max(picture.seconds, 1e-9) / 1e6
    tone = tone_of(out, picture)
    if not quiet:
        stream = session.text_stream(as_json=as_json)
        for warning in picture.warnings:
            where = f"{warning.object}: " if warning.object else ""
            stream.write(f"warning: {where}{warning.message} [{warning.code}]\n")
        stream.write(
            f"{out}: {width} x {height}, {picture.spp} samples a pixel, {picture.seconds:.1f} s,"
            f" {rate:.1f} Mrays/s\n"
        )
        if tone is not None:
            stream.write(f"tone mapping: {tone}\n")
    if as_json:
        eye = picture.camera
        target = [p + f for p, f in zip(eye.position, eye.forward, strict=True)]
        session.write_json(
            {
                "out": str(out),
                "width": width,
                "height": height,
                "spp": picture.spp,
                "seconds": picture.seconds,
                "rays": picture.rays,
                "unit": picture.unit,
                "tone": tone,
                "layers": list(exr_layers(picture)) if tone is None else [],
                "estimator": None if ao or lightmap else estimator,
                "denoised": denoise,
                "mean": [float(v) for v in picture.colour.mean(axis=(0, 1), dtype=float)],
                "camera": {
                    "position": list(eye.position),
                    "target": target,
                    "fov": math.degrees(eye.fov),
                },
                "warnings": [
                    {"code": w.code, "message": w.message, "object": w.object} for w in picture.warnings
                ],
            }
        )
