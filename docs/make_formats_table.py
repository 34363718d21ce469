"""Writes the table of file formats into ENGINES.md: size, memory and error of a page in each encoding.

python docs/make_formats_table.py            writes the table into the page
python docs/make_formats_table.py --print    prints the table instead

The page is the irradiance of the furnished room, 512 x 512, baked with the default quality. A row is computed
from the file as it is read back.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import baker
from baker.core.encoding import BLACK, ENCODINGS, Encoding
from baker.core.lightmap import TexelStatus

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "ENGINES.md"
BEGIN = "<!-- formats, made by docs/make_formats_table.py -->\n"
END = "<!-- end of the formats -->\n"
RESOLUTION = 512
# (encoding, options, name in the table, bytes per texel on the graphics card as the loaders store it)
ROWS = (
    ("exr", {"dtype": "float"}, "`exr`, `--dtype float`", 16),
    ("exr", {}, "`exr` (always written)", 8),
    ("exr", {"exr_compression": "piz"}, "`exr`, `--exr-compression piz`", 8),
    ("hdr", {}, "`hdr`", 8),
    ("ktx2", {}, "`ktx2`", 4),
    ("rgbm", {}, "`rgbm` (PNG)", 8),
    ("webp", {}, "`webp` (RGBM)", 8),
)


def table() -> str:
    """Return the table."""
    result = baker.bake(ROOT / "assets" / "interior.glb", resolution=RESOLUTION, channels=["irradiance"])
    pixels = result.lightmaps["irradiance"].value[0]
    surface = result.status[0] == TexelStatus.COVERED
    rows = [_row(pixels, surface, *row) for row in ROWS]
    head = [
        "| format | KiB | bytes per texel on the card | error: median | 95 % | largest |",
        "|---|---|---|---|---|---|",
    ]
    return "\n".join([*head, *rows]) + "\n"


def _row(
    pixels: np.ndarray, surface: np.ndarray, key: str, options: dict[str, str], name: str, card: int
) -> str:
    encoding: Encoding = ENCODINGS.require(key, "encoding")
    fitted = encoding.fitted(encoding.options_type(**options), float(pixels.max()))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a{encoding.suffix}"
        encoding.encode(path, pixels, options=fitted, header={})
        size = path.stat().st_size
        read = encoding.decode(path).pixels
    error = _errors(pixels[surface].astype(np.float64), read[surface].astype(np.float64))
    return " | ".join([f"| {name}", f"{size / 1024:.0f}", str(card), *map(_percent, error)]) + " |"


def _errors(true: np.ndarray, read: np.ndarray) -> np.ndarray:
    """Return (3, colours): median, 95th percentile and maximum of the relative error of each colour.

    Values below 1 % of the page's mean are left out, because they are displayed as black.
    """
    kept = true > BLACK * true.mean()
    columns = []
    for colour in range(true.shape[1]):
        k = kept[:, colour]
        error = np.abs(read[k, colour] / true[k, colour] - 1.0)
        columns.append([np.median(error), np.quantile(error, 0.95), error.max()])
    return np.array(columns).T


def _percent(colours: np.ndarray) -> str:
    """Return the errors of red, green and blue as percent."""
    return " / ".join(f"{100.0 * value:.2g}" for value in colours) + " %"


def page() -> str:
    """Return the text of ENGINES.md with the new table between its markers."""
    before, _, rest = PAGE.read_text("utf-8").partition(BEGIN)
    return before + BEGIN + "\n" + table() + "\n" + END + rest.partition(END)[2]


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(table())
    else:
        PAGE.write_text(page(), "utf-8")
