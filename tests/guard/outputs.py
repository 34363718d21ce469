"""Records every output of `baker` in small runs of all its features, to compare two commits on one machine.

    python tests/guard/outputs.py --write FILE       records the installed checkout
    python tests/guard/outputs.py --compare FILE     records it again and prints the differences
    python tests/guard/outputs.py --against COMMIT   records both versions and prints the differences

The exit code is 1 if there are differences. The guard, that is this script and the modules `guard_*.py`, uses
only the command line of `baker`, so modules may be moved and renamed. A record is valid on one machine only,
because the processor and libraries change the last bits of results.
"""

from __future__ import annotations

import argparse
import gzip
import json
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

from guard_compare import Record, compare
from guard_record import Program, record
from guard_runs import RUNS

ROOT = Path(__file__).resolve().parents[2]
# Start-up code of a commit's program: it removes the import hook of the editable install, which would find
# modules that the commit does not have.
_NO_EDITABLE = """
import sys

sys.meta_path[:] = [f for f in sys.meta_path if not getattr(f, "__module__", "").startswith("__editable__")]
"""


def main() -> int:
    """Run the guard and return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("--write", type=Path, metavar="FILE", help="record this checkout")
    action.add_argument("--compare", type=Path, metavar="FILE", help="compare this checkout with a record")
    action.add_argument("--against", metavar="COMMIT", help="compare this checkout with a commit")
    parser.add_argument("--only", default="", metavar="RUN,...", help=f"runs: {', '.join(RUNS)}")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="runs at a time (default 2)")
    given = parser.parse_args()
    only = tuple(name.strip() for name in given.only.split(",") if name.strip())
    if set(only) - set(RUNS):
        parser.error(f"unknown runs: {', '.join(sorted(set(only) - set(RUNS)))}")
    if given.against:
        with tempfile.TemporaryDirectory(prefix="guard-") as folder:
            # The kernels of the commit are not compiled yet, so use one process.
            old = _timed(program_of(given.against, Path(folder).resolve()), 1, only)
    elif given.compare:
        old = read(given.compare)
        old["runs"] = {name: run for name, run in old["runs"].items() if not only or name in only}
    new = _timed(installed(), given.processes, only)
    if given.write:
        write(given.write, new)
        return 0
    lines = compare(old, new)
    sys.stdout.write("".join(f"{line}\n" for line in lines or [f"equal: {counted(new)}"]))
    return 1 if lines else 0


def _timed(program: Program, processes: int, only: tuple[str, ...]) -> Record:
    start = time.monotonic()
    found = record(program, processes=processes, only=only)
    sys.stderr.write(f"{program.root}: {counted(found)} in {time.monotonic() - start:.0f} s\n")
    return found


def counted(found: Record) -> str:
    """Return a text with the numbers of runs and files of a record."""
    runs = found["runs"].values()
    lines, files = sum(len(run["steps"]) for run in runs), sum(len(run["files"]) for run in runs)
    return f"{len(runs)} runs, {lines} commands, {files} files"


def write(path: Path, found: Record) -> None:
    """Write a record as compressed JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(gzip.compress(json.dumps(found).encode(), mtime=0))


def read(path: Path) -> Record:
    """Read a record written by `write`."""
    found: Record = json.loads(gzip.decompress(path.read_bytes()))
    return found


def installed() -> Program:
    """Return the program of this checkout, the editable install of this Python."""
    program = Program([str(Path(sys.executable).with_name("baker"))], ROOT)
    source = program.source()
    if not source.is_relative_to(ROOT):
        sys.exit(f"this Python runs {source}, not {ROOT}: use the one in which this checkout is installed")
    return program


def program_of(commit: str, folder: Path) -> Program:
    """Write the files of a commit into a folder and return its program.

    The program runs with this Python and its libraries. Packages that `pyproject.toml` maps to other
    folders are linked at the paths that an install would use.
    """
    archive = subprocess.run(["git", "archive", commit], cwd=ROOT, capture_output=True, check=True).stdout
    subprocess.run(["tar", "-x"], cwd=folder, input=archive, check=True)
    project = tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))
    moved = dict(project["tool"]["setuptools"].get("package-dir", {}))
    base = folder / moved.pop("", ".")
    for package, source in moved.items():
        target = base / package.replace(".", "/")
        if not target.exists():
            target.symlink_to(folder / source)
    (base / "sitecustomize.py").write_text(_NO_EDITABLE)
    # The program reads its version from the metadata of its distribution, whose name differs between commits.
    name, version = project["project"]["name"], project["project"].get("version", "0")
    metadata = base / f"{name.replace('-', '_')}-{version}.dist-info" / "METADATA"
    metadata.parent.mkdir(exist_ok=True)
    metadata.write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    module, function = project["project"]["scripts"]["baker"].split(":")
    start = f"import sys; sys.argv[0] = 'baker'; from {module} import {function}; {function}()"
    program = Program([sys.executable, "-P", "-c", start], folder, base.resolve())
    source = program.source()
    if not source.is_relative_to(folder):
        sys.exit(f"{commit} runs {source}, not its own files")
    return program


if __name__ == "__main__":
    sys.exit(main())
