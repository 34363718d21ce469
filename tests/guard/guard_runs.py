"""The command lines that the guard runs; each list runs in order in a separate folder that has `scenes/`.

A line has the arguments of `baker` as typed in a shell, or begins with @:

- `@view OUT` starts `baker view`, fetches the files that a browser would fetch, and stops it;
- `@copy FROM TO` copies a file, and `@remove PATH` removes one.
"""

from __future__ import annotations

# These runs are done first and one after another. They compile most kernels, and two processes should not
# compile the same kernel at the same time.
FIRST = ("cornell", "holes", "glass", "verify", "pictures")

_TINY = "--resolution 32 --samples 4"
_EXPORTS = "gltf,three,babylon,playcanvas,godot,unity,unreal,bevy,blender,unlit"
_ESTIMATORS = ("uniform", "cosine", "stratified", "light", "bsdf", "mis", "mis-power", "bdpt")
_PICTURE = "--width 32 --height 24 --spp 4"
_COMMANDS = ("bake", "ao", "check", "batch", "verify", "diff", "render", "view", "inspect")

RUNS: dict[str, tuple[str, ...]] = {
    "cornell": (
        "bake scenes/cornell.glb -o one --resolution 64 --samples 16 --threads 1 --json",
        "bake scenes/cornell.glb -o two --resolution 64 --samples 16 --threads 2 -v",
    ),
    "holes": (
        f"bake scenes/holes.glb -o out --sky 10,12,15 {_TINY} --threads 1",
        f"bake scenes/holes.glb -o two --sky 10,12,15 {_TINY} --threads 2 --quiet",
        f"render scenes/holes.glb -o holes.exr {_PICTURE}",
    ),
    "glass": (
        f"bake scenes/glass.glb -o out --sky 10,12,15 {_TINY} --threads 1",
        f"bake scenes/glass.glb -o two --sky 10,12,15 {_TINY} --threads 2 --quiet",
        f"render scenes/glass.glb -o glass.exr {_PICTURE}",
    ),
    "verify": (
        f"bake scenes/cornell.glb -o out {_TINY}",
        "verify out --texels 60 --spp 32 --json --report report.html --junit report.xml --threads 1",
        "verify out --texels 60 --spp 32 --threads 2",
        "verify out --texels 40 --spp 16 --fail-if 'irradiance.median > 0.0001, ao.rmse > 9' --json",
        "verify out --texels 40 --spp 16 --fail-if 'irradiance.nothing > 1'",
    ),
    "pictures": (
        *(
            f"render scenes/cornell.glb -o {name}.exr --estimator {name} {_PICTURE} --json"
            for name in _ESTIMATORS
        ),
        f"render scenes/crates.glb -o ao.exr --ao --camera 1,2,3,0,0,0,45 --threads 1 {_PICTURE}",
        f"render scenes/crates.glb -o all.exr --aov albedo,normal,depth --denoise --sky 1,2,3 {_PICTURE}",
        f"render scenes/crates.glb -o tone.png --max-depth 2 {_PICTURE} --threads 2",
        "bake scenes/crates.glb -o out --resolution 64 --samples 4 --quiet",
        f"render scenes/crates.glb -o baked.png --lightmap out {_PICTURE}",
    ),
    "interior": ("bake scenes/interior.glb -o out --resolution 128 --samples 4 --json",),
    "hall": ("bake scenes/hall.glb -o out --resolution 128 --samples 4 --json",),
    "street": ("bake scenes/street.glb -o out --sky 1600,2000,2600 --resolution 96 --samples 4 --json",),
    "warehouse": ("bake scenes/warehouse.glb -o out --resolution 64 --samples 4 --bounces 1 --json",),
    "instances": (
        "bake scenes/crates.glb -o out --resolution 64 --samples 8 --light-samples 4 --sky 5,5,5 --json",
        "bake scenes/crates.glb -o some --include 'crate*,floor' --exclude sun --no-denoise " + _TINY,
        "bake scenes/crates.glb -o configured --config scenes/bake.toml --seed 9",
        f"check scenes/crates.glb {_TINY}",
    ),
    "kept uv": (
        f"bake scenes/cornell.glb -o first {_TINY} --padding 2",
        "bake first/scene.glb -o second --uv keep --no-denoise --resolution 32 --samples 4 --padding 2",
        "bake first/scene.glb -o third --resolution 64 --samples 4 --padding 2 --json",
        f"bake scenes/cornell.glb -o none --uv keep {_TINY}",
        f"check first/scene.glb {_TINY} --json",
    ),
    "pages": (
        "bake scenes/cornell.glb -o out --density 16 --resolution 64 --samples 4 --export gltf,three,unity",
        "inspect out --json",
        "bake scenes/cornell.glb -o few --density 30 --resolution 64 --max-pages 2 --samples 4",
        "@view out",
    ),
    "importers": (
        f"bake scenes/CornellBox-Original.obj -o obj {_TINY} --json",
        f"bake scenes/corner.ply -o ply {_TINY} --sky 1,1,1",
        f"bake scenes/corner.stl -o stl {_TINY} --sky 1,1,1 --up z --scale 0.1",
        f"bake scenes/corner.off -o off {_TINY} --sky 1,1,1 --json",
        f"bake scenes/square.gltf -o gltf {_TINY} --sky 1,1,1",
        "bake scenes/building-small-a.glb -o building --resolution 128 --samples 2 --sky 1,1,1",
        f"ao scenes/torch_mounted.gltf.glb -o torch {_TINY}",
    ),
    "ao": (
        f"ao scenes/crates.glb -o out {_TINY} --ao-distance 0.5 --json",
        f"ao scenes/crates.glb -o far {_TINY} --ao-samples 8 --ao-distance inf --dtype float --threads 1",
    ),
    "encodings": (
        f"bake scenes/cornell.glb -o all {_TINY} --encode hdr,ktx2,rgbm,png8,png16,webp --json",
        f"bake scenes/cornell.glb -o float {_TINY} --dtype float --exr-compression piz --no-denoise",
        f"bake scenes/cornell.glb -o range {_TINY} --encode rgbm --rgbm-range 500",
        *(f"inspect all/{name} --json" for name in ("irradiance_0.exr", "status_0.png", "bake.json")),
    ),
    "exports": (f"bake scenes/crates.glb -o out --sky 5,5,5 {_TINY} --export {_EXPORTS} --json",),
    "check": (
        "check scenes --json --sarif found.sarif --junit found.xml",
        "check scenes/cornell.glb scenes/interior.glb --fail-on warning --mip 3",
        "check 'scenes/faults/uv.*.glb' --ignore uv.overlap --resolution 64 --quiet",
    ),
    "fix": (
        *(
            f"check scenes/faults/{name}.glb --fix -o {name}.glb --json"
            for name in ("zero-area", "duplicate-faces", "bad-normals", "uv.overlap", "missing-normals")
        ),
        "check scenes/building-small-a.glb --fix -o building.glb",
        "check scenes/faults/non-manifold-edges.glb --repair -o repaired.glb --json",
        "check building.glb --fix -o building.glb",
    ),
    "diff": (
        f"bake scenes/cornell.glb -o a {_TINY} --quiet",
        "bake scenes/cornell.glb -o b --resolution 48 --samples 4 --seed 5 --quiet",
        "diff a b --texels 500 --json --threads 1",
        "diff a b --texels 500 --no-flip --threads 2",
        "diff a a --texels 200 --fail-if 'irradiance.p95 > 0.01'",
        "diff a b --texels 200 --fail-if 'irradiance.p95 > 0.0001' --json",
    ),
    "batch": (
        "@copy scenes/JOBS.toml JOBS.toml",
        "batch JOBS.toml --dry-run",
        "batch JOBS.toml --json --junit batch.xml",
        "batch JOBS.toml --jobs 2",
        "@remove baked/a/ao_0.exr",
        "batch JOBS.toml --json",
    ),
    "inspect": (
        *(
            f"inspect scenes/{name}"
            for name in ("interior.glb", "hall.glb --json", "street.glb --json", "corner.ply", "square.gltf")
        ),
        "inspect scenes/CornellBox-Original.obj --json",
        "inspect scenes/torch_mounted.gltf.glb -v",
    ),
    "failures": (
        f"bake scenes/nowhere.glb -o out {_TINY}",
        f"bake scenes/broken.glb -o out {_TINY} --json",
        f"bake scenes/cornell.glb -o scenes {_TINY}",
        "bake scenes/cornell.glb -o out --resolution 7",
        "bake scenes/cornell.glb -o out --export nothing --json",
        "bake scenes/cornell.glb -o out --encode nothing --json",
        "bake scenes/cornell.glb -o out --channels nothing",
        "bake scenes/cornell.glb -o out --config scenes/unknown.toml",
        "render scenes/cornell.glb -o out.exr --estimator nothing",
        "render scenes/cornell.glb -o out.bmp",
        "verify scenes --json",
        "diff scenes nowhere",
        "batch nowhere.toml",
        "inspect scenes/broken.glb",
        "check scenes/zero_area_face.obj scenes/duplicate_edge.obj --fail-on warning --json",
        "check nowhere.glb",
        "wrong",
    ),
    "help": ("--help", "--version", *(f"{command} --help" for command in _COMMANDS)),
}
