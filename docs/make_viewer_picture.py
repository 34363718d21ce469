"""Makes the picture of the viewer: bakes the interior scene and captures its page in headless Chromium.

python docs/make_viewer_picture.py      needs `pip install '.[engines]'` and Chromium
"""

from __future__ import annotations

import sys
import tempfile
import threading
from pathlib import Path

import baker
from baker.io.bake.read_bake import read_bake
from baker.viewer.script import find_three
from baker.viewer.server import make_server

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests" / "engines"))
from browser import chromium, page_at  # noqa: E402

READY = "document.documentElement.dataset.ready === 'yes'"


def main() -> None:
    """Write docs/pictures/viewer.png."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "interior"
        baker.bake(HERE.parent / "assets" / "interior.glb", out=out, quality="high", resolution=1024)
        server = make_server(read_bake(out), find_three(None))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with chromium(1440, 860) as context, page_at(context, server.url) as (page, troubles):
            page.set_default_timeout(120_000)
            while not page.evaluate(READY):
                page.wait_for_timeout(100)
            page.mouse.click(430, 610)
            page.wait_for_timeout(3000)
            page.screenshot(path=HERE / "pictures" / "viewer.png")
        server.shutdown()
        if troubles:
            sys.exit("\n".join(troubles))


if __name__ == "__main__":
    main()
