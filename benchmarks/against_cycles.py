"""Compares bake times of `baker` and Blender Cycles at equal error, for the same scene, uv and page size.

    python -m venv elsewhere && elsewhere/bin/pip install 'bpy==4.5.*' mitsuba
    python benchmarks/against_cycles.py --python elsewhere/bin/python --markdown

This benchmark needs Blender as a Python module (Python 3.11) and Mitsuba 3, which needs LLVM 17 or newer. If
LLVM is not found, set DRJIT_LIBLLVM_PATH to its library. Install Blender and Mitsuba in an environment
separate from that of `baker`.

`baker` and Cycles bake alternately. The truth is the irradiance that Mitsuba's path tracer computes at random
texels. The error of a texel is |value / truth - 1|, where value and truth are means of R, G and B. Texels
whose truth is below 1 % of the median truth are left out, because they lie inside geometry.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import machine
import numpy as np
from numpy.typing import NDArray
from process import bake
from report import put_into, table

ROOT = Path(__file__).resolve().parent.parent
HERE = Path(__file__).resolve().parent


@dataclass
class Row:
    """The results of one program with one setting, that is, number of samples and denoising.

    Each setting is baked `--repeat` times. `seconds` is the time of the whole process of each bake, and
    `bake_seconds` the time of the bake alone. `error` is the error of the last bake.
    """

    program: str
    samples: int
    denoise: bool
    seconds: list[float]
    bake_seconds: list[float]
    error: dict[str, float]

    @property
    def label(self) -> str:
        """Return program, samples and denoising as text."""
        return f"{self.program}, {self.samples}{', denoised' if self.denoise else ''}"


def main(argv: list[str] | None = None) -> int:
    """Bake alternately with both programs, compute their errors and print the tables."""
    options = _options(argv)
    if options.source:
        result = json.loads(options.source.read_text(encoding="utf-8"))
    else:
        with tempfile.TemporaryDirectory(prefix="baker-against-cycles-") as name:
            result = _compare(options, Path(name))
    if options.json:
        options.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if options.into:
        put_into(options.into, "against_cycles.py", _tables(result, markdown=True))
    else:
        print(_tables(result, markdown=options.markdown))
    return 0


def _options(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--python", default=sys.executable, help="Python that has bpy and mitsuba")
    parser.add_argument(
        "--scene", type=Path, default=ROOT / "assets" / "cornell.glb", help="scene without textures"
    )
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--samples", default="4,16,64,256", help="gather and shadow rays per texel of baker")
    parser.add_argument("--cycles-samples", default="4,16,64,256")
    parser.add_argument("--repeat", type=int, default=2, help="turns; the shortest time is shown")
    parser.add_argument("--texels", type=int, default=1000, help="number of texels to compare")
    parser.add_argument("--spp", type=int, default=32768, help="paths per texel for the truth")
    parser.add_argument("--truth", type=Path, help="file of the truth; read if it exists, else written")
    parser.add_argument("--json", type=Path, help="write all numbers to this file")
    parser.add_argument("--markdown", action="store_true", help="tables as Markdown")
    parser.add_argument("--from", dest="source", type=Path, help="show an earlier --json file; bake nothing")
    parser.add_argument(
        "--into", type=Path, help="insert the tables between the marker lines of this document"
    )
    return parser.parse_args(argv)


def _compare(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    cache, size = folder / "kernels", options.resolution
    flags = ["--resolution", str(size), "--channels", "irradiance", "--dtype", "float"]
    # Unwrap the scene and compile the kernels in a first bake. All later bakes of both programs use its uv.
    bake(options.scene, folder / "first", flags=[*flags, "--samples", "4"], cache=cache)
    scene = folder / "first" / "scene.glb"
    flags += ["--uv", "keep"]
    bake(scene, folder / "warm", flags=[*flags, "--samples", "4", "--no-denoise"], cache=cache)
    surface = folder / "surface.npz"
    mask = _cycles(options, folder, scene, samples=1, denoise=False, surface=surface)[2]["covered"]
    truth = options.truth or folder / "truth.npz"
    if not truth.exists():
        _say(f"truth: {options.texels} texels, {options.spp} paths each")
        versions = _trace_truth(options, folder, surface, mask, truth)
    else:
        versions = {}
    reference = _Truth(truth)
    rows = [
        Row("baker", n, denoise, [], [], {}) for n in _numbers(options.samples) for denoise in (False, True)
    ] + [
        Row("Cycles", n, denoise, [], [], {})
        for n in _numbers(options.cycles_samples)
        for denoise in (False, True)
    ]
    for turn in range(options.repeat):
        for row in rows:
            _say(f"{turn + 1}/{options.repeat}: {row.label}")
            if row.program == "baker":
                count = str(row.samples)
                more = ["--samples", count, "--light-samples", count]
                out = folder / "baker"
                run = bake(
                    scene,
                    out,
                    flags=[*flags, *more, "--denoise" if row.denoise else "--no-denoise"],
                    cache=cache,
                )
                row.seconds.append(run.seconds)
                row.bake_seconds.append(sum(run.timings.values()))
                value = _read_exr(out / "irradiance_0.exr")
            else:
                seconds, told, found = _cycles(options, folder, scene, row.samples, row.denoise)
                row.seconds.append(seconds)
                row.bake_seconds.append(float(found["seconds"]))
                versions |= told
                value = found["irradiance"]
            row.error = reference.error(value)
    return {
        "machine": {**machine.describe(), **versions, "load after": machine.load()},
        "scene": options.scene.stem,
        "resolution": size,
        "truth": reference.quality,
        "rows": [vars(row) | {"label": row.label} for row in rows],
    }


class _Truth:
    """The path-traced irradiance of the compared texels."""

    def __init__(self, path: Path) -> None:
        truth = np.load(path)
        value = truth["irradiance"].mean(axis=1)
        lit = value > 0.01 * np.median(value)
        self._place = truth["row"][lit], truth["column"][lit]
        self._value = value[lit]
        error = truth["standard_error"].mean(axis=1)[lit] / self._value
        self.quality = {
            "texels": int(lit.sum()),
            "spp": int(truth["spp"]),
            "standard_error": float(np.median(error)),
        }

    def error(self, image: NDArray[np.float32]) -> dict[str, float]:
        """Return the errors of an irradiance map (H, W, 3).

        `median` and `p95` are quantiles of the relative error. `bias` is sum(value) / sum(truth) - 1.
        """
        value = image[self._place].mean(axis=1)
        relative = np.abs(value / self._value - 1.0)
        return {
            "median": float(np.median(relative)),
            "p95": float(np.percentile(relative, 95)),
            "bias": float(value.sum() / self._value.sum() - 1.0),
        }


def _cycles(
    options: argparse.Namespace,
    folder: Path,
    scene: Path,
    samples: int,
    denoise: bool,
    surface: Path | None = None,
) -> tuple[float, dict[str, str], dict[str, Any]]:
    """Bake in a Blender process; return its duration in seconds, versions, and the arrays that it wrote."""
    out = folder / "cycles.npz"
    run = {"samples": samples, "denoise": denoise, "seed": 1, "out": str(out)}
    job = {"scene": str(scene), "resolution": options.resolution, "runs": [run]}
    if surface:
        job["surface"] = str(surface)
    start = perf_counter()
    told = _work(options, folder, "cycles_bake.py", job)
    return perf_counter() - start, told, dict(np.load(out))


def _trace_truth(
    options: argparse.Namespace, folder: Path, surface: Path, mask: NDArray[np.bool_], out: Path
) -> dict[str, str]:
    """Path-trace random texels that Cycles covers, that is, texels whose centre lies on the surface.

    Writes the irradiance to `out` and returns the versions of the programs.
    """
    covered = np.flatnonzero(mask.ravel())
    chosen = np.sort(
        np.random.default_rng(0).choice(covered, min(options.texels, len(covered)), replace=False)
    )
    place = {"row": chosen // options.resolution, "column": chosen % options.resolution}
    texels, raw = folder / "texels.npz", folder / "raw.npz"
    np.savez(texels, row=place["row"], column=place["column"])
    job = {
        "surface": str(surface), "texels": str(texels), "resolution": options.resolution,
        "spp": options.spp, "out": str(raw),
    }  # fmt: skip
    told = _work(options, folder, "path_truth.py", job)
    found = np.load(raw)
    np.savez(
        out, row=place["row"], column=place["column"], spp=options.spp,
        irradiance=found["irradiance"], standard_error=found["standard_error"],
    )  # fmt: skip
    return told


def _work(options: argparse.Namespace, folder: Path, script: str, job: dict[str, Any]) -> dict[str, str]:
    path = folder / "job.json"
    path.write_text(json.dumps(job), encoding="utf-8")
    done = subprocess.run([options.python, str(HERE / script), str(path)], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{script} failed: {(done.stderr or done.stdout).strip()[-2000:]}")
    told: dict[str, str] = json.loads(done.stdout.strip().splitlines()[-1])
    return told


def _read_exr(path: Path) -> NDArray[np.float32]:
    import OpenEXR

    pixels: NDArray[np.float32] = OpenEXR.File(str(path)).channels()["RGB"].pixels
    return pixels.astype(np.float32)


def _tables(result: dict[str, Any], *, markdown: bool) -> str:
    rows = [
        (
            row["program"],
            row["samples"],
            "yes" if row["denoise"] else "no",
            min(row["seconds"]), min(row["bake_seconds"]),
            f"{100 * row['error']['median']:.2f} %", f"{100 * row['error']['p95']:.1f} %",
            f"{100 * row['error']['bias']:+.2f} %",
        )
        for row in result["rows"]
    ]  # fmt: skip
    head = ("program", "samples", "denoised", "process s", "bake alone s", "median error", "p95", "bias")
    truth = result["truth"]
    equal = ("Cycles' setting", "its median error", "bake alone s", "baker, no worse", "process s", "times")
    parts = [
        f"{result['scene']}, page {result['resolution']}; truth: {truth['texels']} texels, "
        f"{truth['spp']} paths each, standard error {100 * truth['standard_error']:.2f} % (median)",
        table(head, rows, markdown=markdown),
        table(equal, list(_equal(result["rows"])), markdown=markdown),
        table(("what", "which"), [(k, str(v)) for k, v in result["machine"].items()], markdown=markdown),
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def _equal(rows: list[dict[str, Any]]) -> list[tuple[str | float, ...]]:
    """Return a row for each setting of Cycles, with the fastest setting of baker that is no less accurate.

    A setting of baker is no less accurate if its median error is no larger. The last column is Cycles' time
    divided by baker's time. It is a lower bound, because Cycles' time is that of the bake alone, and baker's
    time is that of the whole process.
    """
    ours = [row for row in rows if row["program"] == "baker"]
    found: list[tuple[str | float, ...]] = []
    for row in rows:
        if row["program"] == "baker":
            continue
        good = [our for our in ours if our["error"]["median"] <= row["error"]["median"]]
        seconds = min(row["bake_seconds"])
        known = (row["label"], f"{100 * row['error']['median']:.2f} %", seconds)
        if good:
            best = min(good, key=lambda our: min(our["seconds"]))
            least = min(best["seconds"])
            found.append((*known, best["label"], f"{least:.2f}", f"{seconds / least:.1f}"))
        else:
            found.append((*known, "none", "", ""))
    return found


def _numbers(text: str) -> list[int]:
    return [int(word) for word in text.split(",")]


def _say(what: str) -> None:
    print(what, file=sys.stderr, flush=True)


if __name__ == "__main__":
    raise SystemExit(main())
