"""Measures `baker`: stage times, memory, ray rates compared with bare Embree, times by triangle count.

    python benchmarks/run.py                     all measurements, about 20 minutes on 2 cores
    python benchmarks/run.py --quick             Cornell at 256 and 10 k triangles, under 3 minutes
    python benchmarks/run.py --json out.json --markdown
    python benchmarks/run.py --from out.json --into docs/PERFORMANCE.md

Each round bakes every scene once at each page size, so that temporary load on the machine affects all bakes.
Tables show the shortest and the median time of all rounds.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import machine
from process import Run, bake
from report import put_into, report
from scenes import write_blobs

ASSETS = Path(__file__).resolve().parent.parent / "assets"
# {scene: radiance of its sky, cd/m2}. All other scenes have no sky.
SKY = {"hall": "2000,2600,3400", "interior": "2000,2600,3400"}


def main(argv: list[str] | None = None) -> int:
    """Measure as the flags request and print the tables."""
    options = _options(argv)
    if options.source:
        result = json.loads(options.source.read_text(encoding="utf-8"))
    else:
        with tempfile.TemporaryDirectory(prefix="baker-benchmark-") as folder:
            result = _measure(options, Path(folder))
    if options.json:
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if options.into:
        put_into(options.into, "run.py", report(result, markdown=True))
    else:
        print(report(result, markdown=options.markdown))
    return 0


def _options(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one small scene, one round")
    parser.add_argument(
        "--scenes", default=None, help="names or files, separated by commas; `none`: no bakes"
    )
    parser.add_argument("--sizes", default=None, help="page sizes, separated by commas")
    parser.add_argument("--samples", type=int, default=64, help="gather rays and shadow rays per texel")
    parser.add_argument(
        "--repeat", type=int, default=None, help="number of rounds; default 3, with --quick 1"
    )
    parser.add_argument(
        "--triangles",
        default=None,
        help="triangle numbers of the series, separated by commas; `none`: no series",
    )
    parser.add_argument("--no-large", action="store_true", help="do not measure memory with a page of 4096")
    parser.add_argument("--no-rates", action="store_true", help="do not measure the bare loops")
    parser.add_argument("--unwrap-large", action="store_true", help="also unwrap the series' largest scene")
    parser.add_argument("--json", type=Path, help="write all numbers to this file")
    parser.add_argument(
        "--from", dest="source", type=Path, help="show an earlier --json file; measure nothing"
    )
    parser.add_argument("--markdown", action="store_true", help="tables as Markdown")
    parser.add_argument(
        "--into", type=Path, help="insert the tables between the marker lines of this document"
    )
    options = parser.parse_args(argv)
    quick = options.quick
    options.repeat = options.repeat or (1 if quick else 3)
    options.scenes = _words(options.scenes or ("cornell" if quick else "cornell,interior,hall"))
    options.sizes = [int(word) for word in _words(options.sizes or ("256" if quick else "256,512,1024"))]
    series = _words(options.triangles or ("10000" if quick else "10000,100000,1000000"))
    options.triangles = [int(word) for word in series]
    options.no_large |= quick
    return options


def _words(text: str) -> list[str]:
    return [] if text == "none" else text.split(",")


def _measure(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    result: dict[str, Any] = {"machine": {**machine.describe(), "load before": machine.load()}}
    cache = folder / "kernels"
    scenes = [path if (path := Path(name)).exists() else ASSETS / f"{name}.glb" for name in options.scenes]
    firsts: dict[tuple[Path, int], Run] = {}
    jobs = [(path, size) for path in scenes for size in options.sizes]
    if jobs:
        # Measure one first run without compiled kernels, with the first scene and the middle page size.
        first = (scenes[0], options.sizes[len(options.sizes) // 2])
        _say(f"first run: {first[0].stem} at {first[1]}")
        firsts[first] = _bake(options, first[0], first[1], folder, cache)
    else:
        # Compile the kernels, so that no later measurement includes compilation.
        _bake(options, ASSETS / "cornell.glb", 64, folder, cache, samples=1)
    bakes: dict[tuple[Path, int], list[Run]] = {job: [] for job in jobs}
    for path in scenes:
        # Bake each scene once, because scenes with other kinds of light compile additional kernels.
        _bake(options, path, 64, folder, cache, samples=1)
    for turn in range(options.repeat):
        for path, size in jobs:
            _say(f"bake {turn + 1}/{options.repeat}: {path.stem} at {size}")
            bakes[path, size].append(_bake(options, path, size, folder, cache))
    result["bakes"] = [
        {
            "scene": path.stem,
            "resolution": size,
            "samples": options.samples,
            "first": firsts[path, size].plain() if (path, size) in firsts else None,
            "runs": [run.plain() for run in bakes[path, size]],
        }
        for path, size in jobs
    ]
    result["rates"] = [] if options.no_rates else _rates(options, scenes)
    result["series"] = _series(options, folder, cache)
    result["large"] = _large(options, folder, cache)
    result["machine"]["load after"] = machine.load()
    return result


def _bake(
    options: argparse.Namespace,
    scene: Path,
    size: int,
    folder: Path,
    cache: Path,
    samples: int | None = None,
    more: tuple[str, ...] = (),
) -> Run:
    count = str(samples or options.samples)
    flags = ["--resolution", str(size), "--samples", count, "--light-samples", count, *more]
    if scene.stem in SKY:
        flags += ["--sky", SKY[scene.stem]]
    return bake(scene, folder / "out", flags=flags, cache=cache)


def _rates(options: argparse.Namespace, scenes: list[Path]) -> list[dict[str, Any]]:
    # Import here, so that `--from` works without Embree.
    from rates import measure_apart

    size = options.sizes[len(options.sizes) // 2]
    found = []
    for path in scenes:
        _say(f"bare Embree: {path.stem} at {size}")
        found.append(
            measure_apart(
                scene_path=path,
                resolution=size,
                samples=options.samples,
                repeat=options.repeat + 2,
                sky=SKY.get(path.stem),
            )
        )
    return found


def _series(options: argparse.Namespace, folder: Path, cache: Path) -> list[dict[str, Any]]:
    size = min(512, max(options.sizes))
    entries: list[dict[str, Any]] = []
    for asked in options.triangles:
        path = folder / f"blobs{asked}.glb"
        entries.append(
            {"asked": asked, "triangles": write_blobs(asked, path), "path": path, "resolution": size}
        )
    runs: dict[int, list[Run]] = {entry["asked"]: [] for entry in entries}
    for turn in range(options.repeat):
        for entry in entries:
            _say(f"series {turn + 1}/{options.repeat}: {entry['triangles']} triangles at {size}")
            runs[entry["asked"]].append(_bake(options, entry["path"], size, folder, cache))
    for entry in entries:
        entry["runs"] = [run.plain() for run in runs[entry["asked"]]]
        if not options.no_rates:
            from rates import measure_apart

            rate = measure_apart(
                scene_path=entry["path"],
                resolution=size,
                samples=options.samples,
                repeat=options.repeat,
                sky=None,
            )
            entry["bare"] = rate["bare"]["closest hit"]["made"]
        else:
            entry["bare"] = float("nan")
        del entry["path"]
    return entries


def _large(options: argparse.Namespace, folder: Path, cache: Path) -> list[dict[str, Any]]:
    """Measure the memory of two bakes with a page of 4096 x 4096 texels.

    The scenes are the interior and the scene of the series with the most triangles. With `--unwrap-large`,
    this scene is also baked with a new unwrap at 1024 x 1024 texels.
    """
    if options.no_large:
        return []
    few = 8
    _say("interior, one page of 4096")
    run = _bake(options, ASSETS / "interior.glb", 4096, folder, cache, samples=few)
    found = [{"what": "interior", "resolution": 4096, "samples": few, "run": run.plain()}]
    if options.triangles:
        most = max(options.triangles)
        path = folder / f"blobs{most}.glb"
        jobs: list[tuple[int, tuple[str, ...]]] = [(4096, ())]
        if options.unwrap_large:
            jobs.append((1024, ("--uv", "unwrap")))
        for size, flags in jobs:
            _say(f"{most} triangles, one page of {size} {' '.join(flags)}")
            run = _bake(options, path, size, folder, cache, samples=few, more=flags)
            what = f"{most} triangles" + (", unwrapped" if flags else ", own uv")
            found.append({"what": what, "resolution": size, "samples": few, "run": run.plain()})
    return found


def _say(what: str) -> None:
    print(what, file=sys.stderr, flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
