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

`baker check SCENE...` lints scenes before they are baked. It takes files, folders and patterns. It writes no
scene file unless `--fix` or `--repair` is given. `docs/make_checks_page.py` generates this page from the
code.

```sh
baker check level.glb                            # errors and warnings; -v adds infos and face numbers
baker check kit/ --fail-on warning --ignore no-light --ignore 'open-edges@Fence*'
baker check level.glb --resolution 2048 --padding 8 --sky 1,1,1   # checked for the settings of this bake
baker check level.glb --cost --resolution 4096   # texels, pages, rays, memory, time, each object's share
baker check level.glb --json                     # {"passed", "findings": [...], "scenes": [...]}
baker check level.glb --sarif check.sarif --junit check.xml
```

| exit code | meaning |
|---|---|
| 0 | no finding reaches the severity of `--fail-on` (default `error`) |
| 1 | a finding reaches it |
| 2 | wrong use |
| 3 | a file cannot be read; all other files are still checked |

If a file can be read but a bake would refuse it (an index out of range, no usable triangle, a negative
light), `check` reports a finding.


Every finding has `code`, `severity`, `object`, `node`, `count`, `message` and `fix`. `node` is the index of
the glTF node; if several nodes show the mesh, it is the first of them. A finding may also have `percent`,
`primitive`, up to ten `faces` (indices within the primitive) or `pairs` of faces, and one `position` in world
space. There are three severities:

- *error*: the bake of the object is useless or impossible.
- *warning*: the result has a visible fault or lacks data.
- *info*: no action is needed.


## Settings of a check

In the file given with `--config`, the table `[check]` has the settings of checks. The file may also contain
the settings of a bake:

```toml
[check]
fail-on = "warning"
ignore = ["no-light", "open-edges@Fence*"]
mip = 3                  # padding must separate charts down to this mip level
rates = "out/level"      # estimate times from the measured speed of this bake
```

A scene may contain settings as glTF `extras`:

| `extras` of | content |
|---|---|
| the document | `{"baker": {"check": {"fail_on": "warning", "ignore": ["no-light"]}}}` |
| a node | `{"baker": {"check": {"ignore": ["open-edges"]}}}`; `"ignore": true` ignores all findings |

The command line overrides the configuration file, and that file overrides the scene. The `ignore` lists of
all three are merged.


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

`baker bake` runs the checks that are marked *in a bake* below. It also reports objects that it leaves out or
unwraps again. These findings are in the `warnings` of `bake.json`, with the same codes.


## How long it takes

A mesh of a million triangles with lightmap UVs takes 10.3 s at `--resolution 2048`. A hundred small kit
pieces, checked by one process, take 5.7 s. Both times were measured on two cores with
`benchmarks/check_speed.py` and include the start of the program.


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
