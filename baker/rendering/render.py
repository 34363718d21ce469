"""Renders a scene through a pinhole camera with the reference path tracer."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.object_settings import NEUTRAL
from baker.core.progress import Progress, report, silent
from baker.core.read_options import ReadOptions
from baker.core.result import Result
from baker.core.scene import Camera, Scene, SceneWarning
from baker.core.stage import Stage
from baker.io.load import load_scene
from baker.io.object_rules import apply_object_settings
from baker.kernels.not_kept import cache_warnings
from baker.pathtracer.camera import parse_camera
from baker.pathtracer.scene import Reference, build_reference
from baker.rendering.baked import BakedLight, other_scene
from baker.rendering.cameras import named_camera
from baker.rendering.passes import RenderRun, ambient_occlusion, first_layers, lit_by, traced
from baker.rendering.settings import RenderSettings


@dataclass(frozen=True, eq=False, repr=False)
class Picture(Result):
    """A rendered picture.

    Attributes
    ----------
    colour : (H, W, 3) float32
        Radiance, cd/m2, linear Rec.709; or ambient occlusion, 0 to 1, in three equal components.
    variance : (H, W, 3) float32
        Squared standard error of `colour` before denoising.
    layers : dict of str to (H, W, C) float32
        Layers requested by the setting `aov`, by name.
    unit : str
        Unit of `colour`: "cd/m2", or "1" for ambient occlusion.
    spp : int
        Number of samples of each pixel.
    rays : int
        Number of rays cast.
    seconds : float
        Duration of the call of `render`.
    camera : Camera
        The camera, in world space.
    warnings : list of SceneWarning
        Warnings of the scene and of the bake that lights it.
    """

    colour: NDArray[np.float32]
    variance: NDArray[np.float32]
    layers: dict[str, NDArray[np.float32]]
    unit: str
    spp: int
    rays: int
    seconds: float
    camera: Camera
    warnings: list[SceneWarning] = field(default_factory=list)

    def summary(self) -> dict[str, Any]:
        """Return the labels and values that the command line prints."""
        height, width = self.colour.shape[:2]
        return {
            "size": f"{width} x {height}",
            "unit": self.unit,
            "samples a pixel": self.spp,
            "mean": float(self.colour.mean()),
            "seconds": self.seconds,
        }

    def picture(self) -> NDArray[np.float32]:
        """Return `colour` (H, W, 3), or ambient occlusion (H, W, 1)."""
        return self.colour if self.unit != "1" else self.colour[..., :1]

    def to_dict(self) -> dict[str, Any]:
        """Return all data except the pixels, as values that JSON can represent."""
        height, width = self.colour.shape[:2]
        eye = self.camera
        return {
            "width": width,
            "height": height,
            "spp": self.spp,
            "seconds": self.seconds,
            "rays": self.rays,
            "unit": self.unit,
            "mean": [float(v) for v in self.colour.mean(axis=(0, 1), dtype=float)],
            "camera": {
                "position": list(eye.position),
                "target": [p + f for p, f in zip(eye.position, eye.forward, strict=True)],
                "fov": math.degrees(eye.fov),
            },
            "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in self.warnings],
        }


def render(
    scene: Scene | Path | str, settings: RenderSettings | None = None, progress: Progress = silent
) -> Picture:
    """Render a scene.

    Parameters
    ----------
    scene : Scene, Path or str
        The scene, or the path of its file. From a file, textures of metallic and roughness are read as well.
        With `settings.lightmap`, the scene of the bake is rendered. If `scene` is then the path of a
        different scene, there is a warning.
    settings : RenderSettings, optional
        Camera, size, samples, and which quantity is rendered.
    progress : Progress
        Called with stage, fraction and a text; a truthy return value cancels.

    Returns
    -------
    Picture
        Pixels, layers, camera and warnings.

    Raises
    ------
    InputError
        If the scene or the bake cannot be read, or if neither the settings nor the scene have a camera.
    SettingsError
        If `settings.camera` is malformed, or the scene has no camera with that name or number.
    ResourceError
        If memory runs out, or if the denoiser cannot be used.
    Cancelled
        If `progress` returned a truthy value.
    """
    settings = settings or RenderSettings()
    start = time.monotonic()
    report(progress, Stage.LOAD, 0.0)
    # If the camera is given as seven numbers, parse them before the scene is loaded. A name is looked up in
    # the scene later.
    text = settings.camera
    camera = parse_camera(text) if text is not None and ("," in text or not text) else None
    if settings.denoise:
        from baker.finish.oidn import denoiser_name

        # Raise an error before any work if the denoiser cannot be used.
        denoiser_name()
    warnings: list[SceneWarning] = []
    baked, sky = None, settings.sky_radiance
    if settings.lightmap is not None:
        baked = BakedLight.read(settings.lightmap)
        warnings = [*baked.bake.warnings]
        if not isinstance(scene, Scene):
            warnings += other_scene(baked.bake, Path(scene), allow_outside=settings.allow_outside)
        scene, sky = _seen(baked.bake.scene), baked.bake.sky if settings.sky is None else sky
    elif not isinstance(scene, Scene):
        scene = _load(scene, settings)
    warnings += [*scene.warnings, *cache_warnings()]
    if text is not None and camera is None:
        camera = named_camera(scene.cameras, text)
    with build_reference(scene, sky=sky, threads=settings.threads) as reference:
        run = RenderRun(reference, camera or _own_camera(scene, reference), settings, start, progress)
        if settings.ao:
            estimate = ambient_occlusion(run, settings.ao_reach(reference.geometry.diagonal))
        elif baked is not None:
            estimate = lit_by(run, baked, sky)
        else:
            estimate = traced(run)
        layers = first_layers(run) if settings.aov or settings.denoise else {}
    shape = (settings.height, settings.width, 3)
    colour = np.broadcast_to(estimate.mean, (run.pixels, 3)).astype(np.float32).reshape(shape)
    variance = np.broadcast_to(estimate.standard_error**2, (run.pixels, 3)).astype(np.float32).reshape(shape)
    if settings.denoise:
        from baker.finish.oidn import filter_picture

        colour = filter_picture(
            colour, albedo=layers["albedo"], normal=layers["normal"], threads=settings.threads or 0,
            progress=progress,
        )  # fmt: skip
    return Picture(
        # Clip, because the denoiser may return values out of range.
        colour=np.clip(colour, 0.0, 1.0 if settings.ao else None),
        variance=variance,
        layers={name: layers[name] for name in settings.aov},
        unit="1" if settings.ao else "cd/m2",
        spp=estimate.rounds * estimate.samples,
        rays=estimate.rays,
        seconds=time.monotonic() - start,
        camera=run.camera,
        warnings=warnings,
    )


def _seen(scene: Scene) -> Scene:
    """Return a baked scene as the camera sees it: with all objects, whatever their effect on light was."""
    return replace(scene, instances=tuple(replace(i, settings=NEUTRAL) for i in scene.instances))


def _load(path: Path | str, settings: RenderSettings) -> Scene:
    """Read a scene file, and apply the settings of its objects."""
    options = ReadOptions.of(settings)
    scene = load_scene(path, options=options, reflections=True, allow_outside=settings.allow_outside)
    return apply_object_settings(scene, settings)


def _own_camera(scene: Scene, reference: Reference) -> Camera:
    """Return the first camera of a scene.

    Raises
    ------
    InputError
        If the scene has no camera. The message suggests a camera that shows the whole scene.
    """
    if scene.cameras:
        return scene.cameras[0]
    position = reference.geometry.position
    low, high = position.min(axis=0).astype(float), position.max(axis=0).astype(float)
    middle, size = (
        0.5 * (low + high) + reference.geometry.origin,
        max(float(np.linalg.norm(high - low)), 1e-6),
    )
    eye = middle + size * np.array([0.35, 0.3, 1.15])
    # Print enough digits to distinguish position and target in scenes far from the origin.
    digits = 4 + int(np.ceil(np.log10(1.0 + np.abs(middle).max() / size)))
    numbers = ",".join(f"{value:.{digits}g}" for value in (*eye, *middle, 45.0))
    raise InputError(
        f"the scene holds no perspective camera; name one, for a view of all: `camera='{numbers}'`",
        file=None if scene.path is None else str(scene.path),
    )
