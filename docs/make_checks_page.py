"""Writes CHECKS.md from the registered checks.

python docs/make_checks_page.py            writes the page
python docs/make_checks_page.py --print    prints it instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.checks.rule import GROUPS, Check, all_checks
from baker.cli.flags import in_flags

PICTURES = Path(__file__).with_name("pictures") / "checks"
NAMES = {
    "geometry": "Geometry",
    "uv": "Lightmap UVs",
    "light": "Light",
    "file": "The file",
    "cost": "Cost",
}

HEAD = """\
# Checks

`baker check SCENE...` lints a scene before it is baked. It takes files, folders and patterns, traces only
a few hundred shadow rays, and writes no file unless `--fix` or `--repair` is given. The program
`docs/make_checks_page.py` generates this page from the code.

```sh
baker check level.glb                            # errors and warnings; -v adds infos and face numbers
baker check kit/ --fail-on warning --ignore no-light --ignore 'open-edges@Fence*'
baker check level.glb --resolution 2048 --padding 8 --sky 1,1,1   # checked for the settings of this bake
baker check level.glb --cost --resolution 4096   # texels, pages, rays, memory, time, each object's share
baker check level.glb --json                     # {"passed", "findings": [...], "scenes": [...]}
baker check level.glb --sarif check.sarif --junit check.xml
```

Exit code 0: no finding reaches the severity of `--fail-on` (default `error`). 1: a finding reaches it. 2:
wrong use. 3: a file cannot be read; all other files are still checked. If a file can be read but a bake
would refuse it (an index out of range, no usable triangle, a negative light), `check` reports a finding.

Every finding has `code`, `severity`, `object`, `node` (glTF node index; if several nodes show the mesh, the
first of them), `count`, `message` and `fix`. If they apply, a finding also has `percent`, `primitive`, up to
ten `faces` (numbers within the primitive) or `pairs` of faces, and one `position` in world space.
Severities: an *error* makes the bake of the object useless or impossible, a *warning* is a visible fault or
missing data in the result, and an *info* needs no action.

## Settings of a check

In the file of `--config`, which may also contain the settings of a bake:

```toml
[check]
fail-on = "warning"
ignore = ["no-light", "open-edges@Fence*"]
mip = 3                  # padding must separate charts down to this mip level
rates = "out/level"      # estimate times from the measured speed of this bake
```

In the scene itself, as glTF `extras`. On the document: `{"baker": {"check": {"fail_on": "warning", "ignore":
["no-light"]}}}`. On a node: `{"baker": {"check": {"ignore": ["open-edges"]}}}`, or `"ignore": true` for
all of its findings. The command line overrides the file, and the file overrides the scene; the `ignore` lists
are merged.

## On every commit

`.pre-commit-hooks.yaml` defines the hook `baker-check` for [pre-commit](https://pre-commit.com):

```yaml
repos:
  - repo: https://example.com/your/copy/of/baker
    rev: v0.1.0
    hooks:
      - id: baker-check
        args: [--fail-on, warning, --ignore, no-light]
```

## In a bake

`baker bake` reports objects that it leaves out or unwraps again in the `warnings` of `bake.json`, under the
same codes, and runs the checks marked *in a bake* below.

## How long it takes

Measured on two cores with `benchmarks/check_speed.py`, including the start of the program: a mesh of a
million triangles with lightmap UVs at 2048 takes 10.3 s, and a hundred small kit pieces in one process take
5.7 s.

## All codes

"""


def page() -> str:
    """Return the text of the page."""
    entries = all_checks()
    parts = [HEAD, "| code | severity | what |\n|---|---|---|\n"]
    parts += [f"| [`{e.code}`](#{_anchor(e.code)}) | {e.severity} | {quoted(e.title)} |\n" for e in entries]
    for group in GROUPS:
        chosen = [entry for entry in entries if entry.group == group]
        if chosen:
            parts.append(f"\n## {NAMES[group]}\n")
            parts += [_section(entry) for entry in chosen]
    return "".join(parts)


def quoted(text: str) -> str:
    """Return a text of the library in which the names of settings are replaced by flags."""
    return in_flags(text, "`")


def _section(entry: Check) -> str:
    notes = f"*{entry.severity}*" + (", *in a bake*" if entry.in_bake else "")
    picture = PICTURES / f"{entry.code}.png"
    shown = (
        f"\n![{entry.code}: bad left, good right](pictures/checks/{picture.name})\n"
        if picture.exists()
        else ""
    )
    return f"\n### {entry.code}\n\n{notes}. {quoted(entry.docs)}\n\nTo do: {quoted(entry.fix)}.\n{shown}"


def _anchor(code: str) -> str:
    # Code hosts form anchors from headings by removing dots and keeping dashes and underscores.
    return code.replace(".", "")


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        Path(__file__).with_name("CHECKS.md").write_text(page(), "utf-8")
