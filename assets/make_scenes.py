"""Makes the project's own scenes: cornell.glb, interior.glb, hall.glb.

    python assets/make_scenes.py            writes the scenes to the folder of this file
    python assets/make_scenes.py FOLDER     writes the scenes to FOLDER

The output is deterministic. A test makes the scenes again and compares the files. Units are metres, cd/m2, cd
and lx; +Y is up.
"""

from __future__ import annotations

import sys
from pathlib import Path

from cornell import make_cornell
from hall import make_hall
from interior import make_interior

SCENES = {"cornell.glb": make_cornell, "interior.glb": make_interior, "hall.glb": make_hall}


def main() -> None:
    """Write all scenes."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in SCENES.items():
        make().write(folder / name)
        print(f"{folder / name}: {(folder / name).stat().st_size} bytes")


if __name__ == "__main__":
    main()
