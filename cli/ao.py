"""`baker ao SCENE -o OUT`: `bake` with ambient occlusion as the only channel."""

from __future__ import annotations

from baker.cli.bake import bake_command
from baker.cli.command import command
from baker.core.settings import BAKE, BakeSettings

# `fixed` also overrides the channels of a configuration file.
ao = command("ao", BakeSettings, fixed={"channels": "ao"}, common=BAKE)(bake_command)
