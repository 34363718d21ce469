"""Writes .pre-commit-hooks.yaml: the hook that runs `baker check` on every scene file of a commit.

python docs/make_hooks.py            writes the file
python docs/make_hooks.py --print    prints it instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.io.formats import scene_suffixes

PAGE = Path(__file__).parents[1] / ".pre-commit-hooks.yaml"


def page() -> str:
    """Return the text of the file, whose pattern matches the suffixes that importers read."""
    suffixes = "|".join(suffix.removeprefix(".") for suffix in scene_suffixes())
    return rf"""# Checks every scene file of a commit. Written by docs/make_hooks.py.
- id: baker-check
  name: baker check
  description: Finds what would spoil a lightmap bake in scene files.
  entry: baker check
  language: python
  files: \.({suffixes})$
  require_serial: true
"""


if __name__ == "__main__":
    if "--print" in sys.argv:
        sys.stdout.write(page())
    else:
        PAGE.write_text(page(), encoding="utf-8")
