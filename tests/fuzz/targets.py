"""Runs `baker` on mutated input; every run must succeed or end with one clear sentence.

A target writes one mutated input into a folder, runs the command through the Python API, and returns a
description of what is wrong, or None. A run is wrong if

- it raises an exception other than `BakerError`;
- the message of the `BakerError` is too long, or has line breaks or control characters;
- it issues a Python warning, such as one of NumPy;
- it finishes a bake with values that are not finite.
"""

from __future__ import annotations

import functools
import json
import re
import resource
import shutil
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mutations import mutate_bytes, mutate_glb, mutate_json, mutate_toml
from numpy.random import Generator

import baker
from baker.cli.config import resolve
from baker.core.errors import BakerError
from baker.core.export import EXPORTS
from baker.core.settings import BakeSettings, make_settings
from baker.io.bake.read_bake import read_bake
from baker.io.inspect import inspect_path
from baker.viewer.answers import page_answers
from baker.viewer.export import export_page
from baker.viewer.script import find_three

ROOT = Path(__file__).parents[2]
SCENES = (
    ROOT / "assets" / "cornell.glb",
    ROOT / "assets" / "levels" / "warehouse.glb",
    ROOT / "assets" / "third-party" / "kaykit-dungeon-torch" / "torch_mounted.gltf.glb",
    ROOT / "assets" / "third-party" / "godot-living-room" / "living_room.glb",
)
# Scenes of the target `load`; the other targets use `SCENES`.
COMPRESSED = tuple(
    ROOT / "tests" / "compressed" / f"cornell.{kind}.glb"
    for kind in ("ext", "khr", "edgebreaker", "sequential")
)
SMALL = {"resolution": 64, "samples": 1, "bounces": 1, "threads": 1, "denoise": False}
LONGEST_MESSAGE = 1000

Target = Callable[[Path, Path, Generator], str | None]
TARGETS: dict[str, Target] = {}
# Numbers of runs that succeeded, and of runs that raised a `BakerError`.
ANSWERS = Counter({"accepted": 0, "refused": 0})


def scenes_of(name: str) -> tuple[Path, ...]:
    """Return the scenes of a target."""
    return COMPRESSED if name == "load" else SCENES


def target(function: Target) -> Target:
    """Register a target under its function's name."""
    TARGETS[function.__name__] = function
    return function


def wrong_answer(run: Callable[[], Any]) -> str | None:
    """Call a function. Return what is wrong, or None if it returns or raises a valid `BakerError`."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            run()
            ANSWERS["accepted"] += 1
        except BakerError as error:
            ANSWERS["refused"] += 1
            text = str(error)
            if len(text) > LONGEST_MESSAGE:
                return f"a message of {len(text)} characters: {text[:200]!r}"
            if any(not c.isprintable() for c in text):
                return f"a message with control characters: {text!r}"
        except Exception:  # any other exception is a defect
            return traceback.format_exc()
    return None


def mutated_scene(scene: Path, folder: Path, rng: Generator) -> Path:
    """Write a mutation of a scene, and return its path."""
    path = folder / "mutated.glb"
    path.write_bytes(mutate_glb(scene.read_bytes(), rng))
    return path


@target
def bake(scene: Path, folder: Path, rng: Generator) -> str | None:
    """Bake a mutated scene in memory; all values must be finite."""
    path = mutated_scene(scene, folder, rng)

    def run() -> None:
        result = baker.bake(path, **SMALL)
        for name, lightmap in result.lightmaps.items():
            assert np.isfinite(lightmap.value).all(), f"{name} is not finite"

    return wrong_answer(run)


loaded = functools.cache(baker.load)


@target
def load(scene: Path, folder: Path, rng: Generator) -> str | None:
    """Load a mutated compressed scene in at most 10 s and 2 GiB, child processes included."""
    # The first scene compiles kernels.
    loaded(scene)
    path = mutated_scene(scene, folder, rng)
    begin = time.monotonic()
    found = wrong_answer(lambda: baker.load(path))
    seconds = time.monotonic() - begin
    memory = max(
        resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    if found is None and (seconds > 10.0 or memory > 2 << 20):
        found = f"took {seconds:.1f} s and {memory / 2**20:.2f} GiB"
    return found


@target
def fix(scene: Path, folder: Path, rng: Generator) -> str | None:
    """Fix a mutated scene; the written file must be readable."""
    path = mutated_scene(scene, folder, rng)

    def run() -> None:
        baker.repair(path, folder / "fixed.glb", force=True, resolution=32, threads=1)
        baker.load(folder / "fixed.glb")

    return wrong_answer(run)


@target
def check(scene: Path, folder: Path, rng: Generator) -> str | None:
    """Check a mutated scene."""
    path = mutated_scene(scene, folder, rng)
    return wrong_answer(lambda: baker.check(path, bake=make_settings({"resolution": 32})))


@target
def damaged(scene: Path, folder: Path, rng: Generator) -> str | None:
    """Damage the manifest or another file of a bake, then verify, compare, inspect, view and export it."""
    sound = folder / f"sound-{scene.stem}"
    if not sound.exists():
        baker.bake(scene, out=sound, **SMALL)
    out = folder / "damaged"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(sound, out)
    if rng.random() < 0.6:
        manifest = json.loads((out / "bake.json").read_text("utf-8"))
        text = json.dumps(mutate_json(manifest, rng))
        (out / "bake.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    else:
        files = sorted(p for p in out.iterdir() if p.is_file())
        file = files[int(rng.integers(len(files)))]
        file.write_bytes(mutate_bytes(file.read_bytes(), rng))
    engine = EXPORTS.names()[int(rng.integers(len(EXPORTS.names())))]
    runs: tuple[Callable[[], Any], ...] = (
        lambda: baker.verify(out, spp=1, texels=8, threads=1),
        lambda: baker.diff(out, sound),
        lambda: inspect_path(out),
        lambda: view(out, folder / "page"),
        lambda: export(out, engine, folder / "exported"),
    )
    return next((found for run in runs if (found := wrong_answer(run)) is not None), None)


def view(out: Path, page: Path) -> None:
    """Build the viewer page of a bake as static files and as the server's answers, without a browser.

    All addresses must be of files inside the page, and all contents must be readable.
    """
    shutil.rmtree(page, ignore_errors=True)
    stored, three = read_bake(out), find_three(None)
    export_page(stored, three, page)
    for address, (_, content) in page_answers(stored, three).items():
        assert re.fullmatch(r"([\w-][\w.-]*(/|$))*", address), f"the address {address!r}"
        assert isinstance(content(), bytes)


def export(out: Path, engine: str, folder: Path) -> None:
    """Export a bake for an engine into a new folder."""
    shutil.rmtree(folder, ignore_errors=True)
    baker.export(out, engine, folder)


JOBS = """
[defaults]
out = "baked/{parent}/{stem}"
resolution = 32
quality = "preview"

[[job]]
glob = "*.glb"
channels = ["ao"]

[[job]]
scene = ["b.glb"]
out = "baked/b2"
seed = 3
encode = ["rgbm"]
export = ["three"]
max-pages = 8
"""
CONFIG = """
[bake]
resolution = 64
samples = 8
sky = [1.0, 1.0, 1.0]
density = 12.5
quality = "high"
channels = ["ao", "irradiance"]
denoise = false
seed = 7
bounces = 3
include = ["a*", "b"]
"""


@target
def jobs(scene: Path, folder: Path, rng: Generator) -> str | None:
    """Read a mutated jobs file."""
    for name in ("a.glb", "b.glb"):
        if not (folder / name).exists():
            shutil.copy(scene, folder / name)
    path = folder / "jobs.toml"
    path.write_bytes(mutate_toml(JOBS, rng))
    return wrong_answer(lambda: baker.batch(path, dry_run=True))


@target
def config(scene: Path, folder: Path, rng: Generator) -> str | None:
    """Read a mutated config file of `bake`."""
    path = folder / "baker.toml"
    path.write_bytes(mutate_toml(CONFIG, rng))
    return wrong_answer(lambda: resolve([BakeSettings], {}, path))
