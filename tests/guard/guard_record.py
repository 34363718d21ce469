"""Runs the guard's command lines with one version of `baker`. Records the output and the written files."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urljoin, urlsplit
from urllib.request import urlopen

from guard_normal import file_entry, hashed, text_entry
from guard_runs import FIRST, RUNS
from guard_scenes import write_scenes

# Time after which a command is killed, seconds. Compiling all kernels of a command takes 60 to 120 s on one
# core.
LONGEST = 900
_LINK = re.compile(r"""(?:src=|href=|from |import )["']([^"':]+)["']""")

Record = dict[str, Any]


@dataclass(frozen=True)
class Program:
    """The command and folders with which one version of `baker` is started.

    Attributes
    ----------
    command : list of str
        First words of the command line; the arguments are appended.
    root : Path
        Root folder of the checkout.
    path : Path or None
        Folder that contains the packages; None for the installed ones.
    """

    command: list[str]
    root: Path
    path: Path | None = None

    @property
    def environment(self) -> dict[str, str]:
        """Return the environment variables for the program's processes."""
        kept = {name: text for name, text in os.environ.items() if not name.startswith(("PYTHON", "LC_"))}
        for name in ("FORCE_COLOR", "TERMINAL_WIDTH"):
            kept.pop(name, None)
        more = {} if self.path is None else {"PYTHONPATH": str(self.path)}
        return {**kept, **more, "COLUMNS": "100", "TERM": "dumb", "NO_COLOR": "1", "LC_ALL": "C.UTF-8"}

    def source(self) -> Path:
        """Return the path of the `baker/__init__.py` that the program imports."""
        words = [sys.executable, "-P", "-c", "import baker; print(baker.__file__)"]
        found = subprocess.run(words, env=self.environment, capture_output=True, text=True, check=True)
        return Path(found.stdout.strip()).resolve()


def record(program: Program, *, processes: int = 2, only: tuple[str, ...] = ()) -> Record:
    """Run all command lines of the guard, or those of `only`, and return the record.

    Parameters
    ----------
    program : Program
    processes : int
        Number of runs at a time; the runs of `FIRST`, which compile most kernels, run one at a time.
    only : tuple of str
        Names of runs; empty for all.
    """
    names = [name for name in RUNS if not only or name in only]
    with tempfile.TemporaryDirectory(prefix="guard-") as folder:
        place = Path(folder).resolve()
        write_scenes(place / "scenes")
        found = {name: _run(program, name, place) for name in names if name in FIRST}
        with ThreadPoolExecutor(processes) as pool:
            rest = [name for name in names if name not in FIRST]
            found |= zip(rest, pool.map(lambda name: _run(program, name, place), rest), strict=True)
    return {"format": 1, "runs": {name: found[name] for name in names}}


def _run(program: Program, name: str, place: Path) -> Record:
    """Do one run in a new folder below `place` and return its record."""
    folder = place / name.replace(" ", "-")
    shutil.copytree(place / "scenes", folder / "scenes")
    given = {path: hashed(path.read_bytes()) for path in _files(folder)}
    temporary = folder.with_name(f"{folder.name}-temporary")
    temporary.mkdir()
    places = {str(folder): "<run>", str(temporary): "<temporary>", str(program.root): "<root>"}
    if program.path is not None:
        places[str(program.path)] = "<root>"
    steps = [_step(program, line, folder, temporary, places) for line in RUNS[name]]
    files = {
        path.relative_to(folder).as_posix(): file_entry(path, places)
        for path in _files(folder)
        if given.pop(path, None) != hashed(path.read_bytes())
    }
    for path in given:
        if not path.exists():
            files[path.relative_to(folder).as_posix()] = {"kind": "removed", "sha256": ""}
    left = sorted(path.name for path in temporary.iterdir())
    shutil.rmtree(folder)
    return {"steps": steps, "files": files, "left": left}


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def _step(program: Program, line: str, folder: Path, temporary: Path, places: dict[str, str]) -> Record:
    words = shlex.split(line)
    environment = {**program.environment, "TMPDIR": str(temporary)}
    if words[0] == "@remove":
        (folder / words[1]).unlink(missing_ok=True)
        return {"command": line}
    if words[0] == "@copy":
        shutil.copyfile(folder / words[1], folder / words[2])
        return {"command": line}
    if words[0] == "@view":
        return {"command": line, **_view(program, words[1], folder, environment, places)}
    done = subprocess.run(
        [*program.command, *words], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=LONGEST,
    )  # fmt: skip
    return {"command": line, **_said(done.returncode, done.stdout, done.stderr, places)}


def _said(code: int, out: str, errors: str, places: dict[str, str]) -> Record:
    return {"exit": code, "stdout": text_entry(out, places), "stderr": text_entry(errors, places)}


def _view(
    program: Program, out: str, folder: Path, environment: dict[str, str], places: dict[str, str]
) -> Record:
    """Start `baker view`, fetch its pages into `fetched/`, and stop it with the signal of Ctrl-C."""
    process = subprocess.Popen(
        [*program.command, "view", out, "--json", "--no-browser"], cwd=folder, env=environment,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    told, found = "", None
    try:
        assert process.stdout is not None
        for line in process.stdout:
            told += line
            try:
                found = json.loads(told)
                break
            except ValueError:
                continue
        if found is not None and "url" in found:
            _fetch(found["url"], folder / "fetched")
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=LONGEST)
    finally:
        process.kill()
    said = _said(process.returncode, told + rest, errors, places)
    if found is not None:
        # The port is a random free one, so record 0.
        said["stdout"] = text_entry(json.dumps({**found, "port": 0}), places)
    return said


def _fetch(url: str, target: Path) -> None:
    """Fetch the page, all files to which it links, and the data of the bake."""
    todo = ["/", "/scene.json", "/geometry", "/status/0", "/out/bake.json"]
    todo += [f"/page/{channel}/{page}" for channel in ("irradiance", "ao") for page in (0, 1)]
    seen: set[str] = set()
    target.mkdir()
    while todo:
        address = todo.pop()
        if address in seen:
            continue
        seen.add(address)
        try:
            with urlopen(urljoin(url, address), timeout=30) as answer:
                content, kind = answer.read(), answer.headers["Content-Type"]
        except HTTPError as error:
            content, kind = b"", f"status {error.code}"
        (target / (address.strip("/").replace("/", "_") or "index")).write_bytes(content)
        (target / "types.txt").open("a").write(f"{address} {kind}\n")
        if address.startswith("/static") or address == "/":
            links = _LINK.findall(content.decode()) if kind.startswith("text/") else []
            todo += [urlsplit(urljoin(address, link)).path for link in links]
