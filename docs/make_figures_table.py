"""Writes the table of all figures into ACCURACY.md, from `baker.metrics.figures`.

python docs/make_figures_table.py            writes the table into the page
python docs/make_figures_table.py --print    prints the new page instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.metrics.figures import FIGURES

PAGE = Path(__file__).parent / "ACCURACY.md"
BEGIN = "<!-- figures, made by docs/make_figures_table.py -->\n"
END = "<!-- end of the figures -->\n"


def table() -> str:
    """Return the table."""
    rows = [f"| `{name}` | {figure.phrase} |" for name, figure in FIGURES.items()]
    return "| figure | in a phrase |\n|---|---|\n" + "\n".join(rows) + "\n"


def page() -> str:
    """Return the text of ACCURACY.md with the new table between its markers."""
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    return before + BEGIN + "\n" + table() + "\n" + END + rest.partition(END)[2]


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        PAGE.write_text(page(), "utf-8")
