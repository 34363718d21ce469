"""The table of file formats in ENGINES.md is what `docs/make_formats_table.py` measures."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

pytestmark = pytest.mark.engines

ROOT = Path(__file__).parents[2]
NUMBER = re.compile(r"\d+(?:\.\d+)?")


def test_the_table_of_formats_is_current() -> None:
    made = runpy.run_path(str(ROOT / "docs" / "make_formats_table.py"), run_name="made")
    page = (ROOT / "docs" / "ENGINES.md").read_text("utf-8")
    table, stored = made["table"](), page.split(made["BEGIN"])[1].split(made["END"])[0].strip() + "\n"
    # The last bits of a bake depend on the processor, so numbers may differ a little.
    assert NUMBER.sub("n", stored) == NUMBER.sub("n", table)
    numbers = [[float(number) for number in NUMBER.findall(text)] for text in (stored, table)]
    assert numbers[0] == pytest.approx(numbers[1], rel=0.1)
