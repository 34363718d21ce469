"""Makes game levels as designers build them, with parts that intersect, for tests of their light.

    python assets/make_levels.py            writes the levels of `KEPT` to the folder assets/levels
    python assets/make_levels.py FOLDER     writes all levels to FOLDER

The radiance of each level's sky is written to levels.json in the same folder. The output is deterministic.
Tests make the levels again and compare the files. Units are metres, cd/m2, cd and lx; +Y is up.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import levels_indoors as indoors
import levels_outdoors as outdoors
from level_parts import Level

LEVELS: dict[str, Callable[[], Level]] = {
    "street": outdoors.make_street,
    "huts": outdoors.make_huts,
    "greenhouse": outdoors.make_greenhouse,
    "rocks": outdoors.make_rocks,
    "grove": outdoors.make_grove,
    "skybox": outdoors.make_skybox,
    "hulls": outdoors.make_hulls,
    "balcony": outdoors.make_balcony,
    "cave": outdoors.make_cave,
    "closed": indoors.make_closed,
    "garage": indoors.make_garage,
    "corridors": indoors.make_corridors,
    "storeys": indoors.make_storeys,
    "decals": indoors.make_decals,
    "tunnel": indoors.make_tunnel,
    "kitchen": indoors.make_kitchen,
    "church": indoors.make_church,
    "warehouse": indoors.make_warehouse,
    "cellar": indoors.make_cellar,
    "centimetres": indoors.make_centimetres,
}
# Levels that are stored in the repository. `tests/e2e/test_levels.py` compares their light with known values.
KEPT = ("closed", "garage", "street", "tunnel", "warehouse")


def main() -> None:
    """Write the levels."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "levels"
    folder.mkdir(parents=True, exist_ok=True)
    skies = {}
    for name in LEVELS if len(sys.argv) > 1 else KEPT:
        level = LEVELS[name]()
        level.glb.write(folder / f"{name}.glb")
        skies[name] = level.sky
        print(f"{folder / name}.glb: {(folder / f'{name}.glb').stat().st_size} bytes")
    (folder / "levels.json").write_text(json.dumps(skies, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
