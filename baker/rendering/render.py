"""Renders a scene through a pinhole camera with the reference path tracer."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import SettingsError
from baker.core.progress import Progress, report, silent
from baker.core.scene import Camera, Scene, SceneWarning
from baker.core.settings import make_settings
from baker.io.load import load_scene
from baker.reference.camera import camera_rays, look_at, parse_camera
from baker.reference.estimators import estimator_named
from baker.reference.first_hit import FirstHits, first_hits
from baker.reference.irradiance import PointEstimate, add_pass, new_estimate, openness_pass
from baker.reference.radiance import radiance_pass
from baker.reference.view import Reference, build_reference
from baker.rendering.baked import BakedLight

AOVS = ("albedo", "normal", "depth")
# Samples of a pixel in one pass.
_PASS, _OPENNESS_PASS = 4, 16
_AOV_SAMPLES = 4


@dataclass(frozen=True)
class RenderSettings:
    """What is rendered.

    Attributes
    ----------
    camera : str or None
        See `parse_camera`; None takes the file's first camera, or one that sees the whole scene.
    width, height : int
    spp : int or None
        Paths for each pixel; None renders until the time limit (64 without one).
    time_limit : float or None
        Seconds.
    estimator : str
    max_depth : int or None
        Vertices of a path after the camera: 1 shows lamps and directly lit surfaces. None is unlimited.
    ao : bool
        Ambient occlusion instead of light; `ao_distance` in metres or per cent of the diagonal.
    aov : tuple of str
        Of `AOVS`.
    denoise : bool
    lightmap : Path or None
        Output folder of a bake: the scene is lit by its maps, without any path.
    sky : str
        As `bake` takes it.
    """

    camera: str | None = None
    width: int = 640
    height: int = 480
    spp: int | None = None
    time_limit: float | None = None
    estimator: str = "mis"
    max_depth: int | None = None
    ao: bool = False
    ao_distance: str | None = None
    aov: tuple[str, ...] = ()
    denoise: bool = False
    lightmap: Path | None = None
    sky: str | None = None
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        for name in ("width", "height"):
            if not 1 <= getattr(self, name) <= 16384:
                raise SettingsError(f"--{name} must be 1 to 16384", object=name)
        if self.spp is not None and self.spp < 1:
            raise SettingsError("--spp must be at least 1", object="spp")
        if self.time_limit is not None and not self.time_limit > 0:
            raise SettingsError("--time-limit must be above 0", object="time_limit")
        if self.max_depth is not None and self.max_depth < 1:
            raise SettingsError("--max-depth must be at least 1", object="max_depth")
        if self.ao and self.lightmap is not None:
            raise SettingsError("--ao and --lightmap exclude each other", object="ao")
        estimator_named(self.estimator)
        unknown = [name for name in self.aov if name not in AOVS]
        if unknown:
            raise SettingsError(f"there is no AOV '{unknown[0]}'; known are {', '.join(AOVS)}", object="aov")


@dataclass(frozen=True)
class Picture:
    """A rendered picture.

    Attributes
    ----------
    colour : (H, W, 3) float32, cd/m2, or the open share three times
    variance : (H, W, 3) float32, of `colour` before any denoising
    layers : dict of name to (H, W, C) float32
    unit : str
    spp, rays : int; seconds : float
    camera : Camera
    warnings : list of SceneWarning
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


def render(
    scene: Scene | Path | str, settings: RenderSettings | None = None, progress: Progress = silent
) -> Picture:
    """Render a scene.

    Parameters
    ----------
    scene : Scene, Path or str
        Of a path, textures of metallic and roughness are read, too.

    Raises
    ------
    InputError, SettingsError, ResourceError, Cancelled
    """
    settings = settings or RenderSettings()
    start = time.monotonic()
    report(progress, "load", 0.0)
    options: dict[str, Any] = {} if settings.sky is None else {"sky": settings.sky}
    if settings.ao_distance is not None:
        options["ao_distance"] = settings.ao_distance
    resolved = make_settings(options)
    baked = BakedLight.read(settings.lightmap) if settings.lightmap is not None else None
    if baked is not None:
        scene = baked.bake.scene
    elif not isinstance(scene, Scene):
        scene = load_scene(scene, reflections=True)
    sky = baked.sky if baked is not None and settings.sky is None else resolved.sky_radiance
    with build_reference(scene, sky=sky, threads=settings.threads) as reference:
        camera = _camera(scene, reference, settings)
        goal = settings.spp if settings.spp is not None else (None if settings.time_limit else 64)
        if settings.ao:
            distance = resolved.ao_reach(reference.geometry.diagonal)
            estimate = _openness(reference, camera, distance, settings, goal, start, progress)
        elif baked is not None:
            estimate = _lit_by(baked, reference, camera, sky, settings, goal, start, progress)
        else:
            estimate = _radiance(reference, camera, settings, goal, start, progress)
        layers = _layers(reference, camera, settings) if settings.aov or settings.denoise else {}
    shape = (settings.height, settings.width, 3)
    colour = np.broadcast_to(estimate.mean, (shape[0] * shape[1], 3)).astype(np.float32).reshape(shape)
    error = np.where(np.isfinite(estimate.standard_error), estimate.standard_error, 0.0)
    variance = np.broadcast_to(error**2, (shape[0] * shape[1], 3)).astype(np.float32).reshape(shape)
    if settings.denoise:
        from baker.finish.oidn import filter_picture

        colour = filter_picture(
            colour, albedo=layers["albedo"], normal=layers["normal"], threads=settings.threads or 0,
            progress=progress,
        )  # fmt: skip
    return Picture(
        colour=np.maximum(colour, 0.0),
        variance=variance,
        layers={name: layers[name] for name in settings.aov},
        unit="1" if settings.ao else "cd/m2",
        spp=estimate.rounds * estimate.samples,
        rays=estimate.rays,
        seconds=time.monotonic() - start,
        camera=camera,
        warnings=list(scene.warnings),
    )


def _camera(scene: Scene, reference: Reference, settings: RenderSettings) -> Camera:
    if settings.camera is not None:
        return parse_camera(settings.camera)
    if scene.cameras:
        return scene.cameras[0]
    position = reference.geometry.position
    low, high = position.min(axis=0).astype(float), position.max(axis=0).astype(float)
    middle, size = 0.5 * (low + high), max(float(np.linalg.norm(high - low)), 1e-6)
    eye = middle + size * np.array([0.35, 0.3, 1.15])
    return look_at((eye[0], eye[1], eye[2]), (middle[0], middle[1], middle[2]), 45.0)


def _enough(
    estimate: PointEstimate, goal: int | None, start: float, settings: RenderSettings, progress: Progress
) -> bool:
    """Tell if rendering may end, and report how far it is."""
    done = estimate.rounds * estimate.samples
    spent = time.monotonic() - start
    share = max(
        0.0 if goal is None else done / goal,
        0.0 if settings.time_limit is None else spent / settings.time_limit,
    )
    report(progress, "rendering", min(share, 1.0), f"{done} samples a pixel")
    # Two passes at least: there is no variance of one.
    return estimate.rounds >= 2 and share >= 1.0


def _radiance(
    reference: Reference,
    camera: Camera,
    settings: RenderSettings,
    goal: int | None,
    start: float,
    progress: Progress,
) -> PointEstimate:
    samples = _PASS if goal is None else max(min(_PASS, goal // 2), 1)
    estimate = new_estimate(settings.width * settings.height, 3, samples)
    bounces = None if settings.max_depth is None else settings.max_depth - 1
    while not _enough(estimate, goal, start, settings, progress):
        radiance_pass(
            reference, estimate, camera, settings.width, settings.height,
            estimator=settings.estimator, max_bounces=bounces, seed=settings.seed, progress=progress,
        )  # fmt: skip
    return estimate


def _hits(
    reference: Reference, camera: Camera, settings: RenderSettings, number: int, samples: int = 1
) -> FirstHits:
    pixel = np.arange(settings.width * settings.height)
    way = camera_rays(camera, settings.width, settings.height, pixel, samples, settings.seed, number)
    return first_hits(reference, np.array(camera.position), way.reshape(-1, 3))


def _openness(
    reference: Reference,
    camera: Camera,
    distance: float,
    settings: RenderSettings,
    goal: int | None,
    start: float,
    progress: Progress,
) -> PointEstimate:
    """Render ambient occlusion; where nothing is met it is open."""
    n = settings.width * settings.height
    estimate = new_estimate(n, 1, _OPENNESS_PASS)
    while not _enough(estimate, goal, start, settings, progress):
        hits = _hits(reference, camera, settings, estimate.rounds)
        met = np.flatnonzero(hits.triangle >= 0)
        one = new_estimate(len(met), 1, _OPENNESS_PASS)
        one.rounds = estimate.rounds
        where = (a[met][:, None] for a in (hits.position, hits.normal, hits.face_normal))
        openness_pass(reference, one, *where, distance=distance, seed=settings.seed)
        share = np.ones((n, 1))
        share[met] = one.mean
        add_pass(estimate, np.arange(n), share)
        estimate.rounds += 1
        estimate.rays += n + one.rays
    return estimate


def _lit_by(
    baked: BakedLight,
    reference: Reference,
    camera: Camera,
    sky: tuple[float, float, float],
    settings: RenderSettings,
    goal: int | None,
    start: float,
    progress: Progress,
) -> PointEstimate:
    """Render what an engine shows: albedo x map / pi + emission, black backs, the sky behind."""
    n = settings.width * settings.height
    estimate = new_estimate(n, 3, 1)
    while not _enough(estimate, goal if goal is not None else 16, start, settings, progress):
        hits = _hits(reference, camera, settings, estimate.rounds)
        light = baked.radiance(reference, hits)
        light[hits.triangle < 0] = sky
        add_pass(estimate, np.arange(n), light)
        estimate.rounds += 1
        estimate.rays += n
    return estimate


def _layers(reference: Reference, camera: Camera, settings: RenderSettings) -> dict[str, NDArray[np.float32]]:
    """Return albedo, normal and depth of first hits, each the mean over a few samples; depth of the first."""
    shape = (settings.height, settings.width)
    total: dict[str, Any] = {"albedo": 0.0, "normal": 0.0}
    depth = None
    for number in range(_AOV_SAMPLES):
        hits = _hits(reference, camera, settings, number)
        total["albedo"] = total["albedo"] + hits.albedo / _AOV_SAMPLES
        total["normal"] = total["normal"] + hits.normal / _AOV_SAMPLES
        if depth is None:
            depth = np.where(np.isfinite(hits.depth), hits.depth, 0.0)
    found = {name: value.astype(np.float32).reshape(*shape, 3) for name, value in total.items()}
    found["depth"] = np.asarray(depth, np.float32).reshape(*shape, 1)
    return found
