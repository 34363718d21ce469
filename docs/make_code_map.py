"""Writes the code map of ARCHITECTURE.md: packages in the order of layers, with their first docstring line.

python docs/make_code_map.py            writes the map into the page
python docs/make_code_map.py --print    prints the new page instead
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "ARCHITECTURE.md"
BEGIN, END = "<!-- code map, made by docs/make_code_map.py -->\n", "<!-- end of the code map -->\n"


def folder_of(package: str) -> Path:
    """Return the folder of a package in this checkout."""
    return ROOT / "cli" if package == "baker.cli" else ROOT.joinpath(*package.split("."))


def layers() -> list[list[str]]:
    """Return the packages of each layer of the import contract, the highest layer first."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    found = next(contract["layers"] for contract in contracts if contract["type"] == "layers")
    return [sorted(re.findall(r"[\w.]+", layer)) for layer in found]


def first_line(package: str) -> str:
    """Return the first line of a package's docstring."""
    text = (folder_of(package) / "__init__.py").read_text("utf-8")
    return (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0]


def rows(package: str) -> list[str]:
    """Return the table rows of a package and, recursively, of its subpackages."""
    folder = folder_of(package)
    found = [f"| `{folder.relative_to(ROOT).as_posix()}/` | {first_line(package)} |"]
    for inner in sorted(path.parent.name for path in folder.glob("*/__init__.py")):
        found += rows(f"{package}.{inner}")
    return found


def code_map() -> str:
    """Return the table."""
    found = [row for layer in layers() for package in layer for row in rows(package)]
    return "| package | what is in it |\n|---|---|\n" + "\n".join(found) + "\n"


def page() -> str:
    """Return the text of ARCHITECTURE.md with the new table between its markers."""
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    return before + BEGIN + "\n" + code_map() + "\n" + END + rest.partition(END)[2]


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        PAGE.write_text(page(), "utf-8")
