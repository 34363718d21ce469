"""Writes SETTINGS.md from the settings themselves, a section for each command.

python docs/make_settings_page.py            writes the page
python docs/make_settings_page.py --print    prints it instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.checks.settings import CheckSettings
from baker.cli.fields import default_of, flag_of, is_switch, metavar_of, range_of, unit_of
from baker.comparison.settings import DiffSettings
from baker.core.settings import BakeSettings
from baker.core.settings_model import Settings
from baker.jobs.settings import BatchSettings
from baker.rendering.settings import RenderSettings
from baker.repairs.settings import RepairSettings
from baker.verification.settings import VerifySettings

HEAD = """\
# Settings

Every setting of every command: as a flag, as a key of the file given with `--config`, and as a keyword of the
function of the Python API. The command line wins over the file, the file over the default.
This page is made from the code by `docs/make_settings_page.py`.
"""

SECTIONS: list[tuple[type[Settings], str, str]] = [
    (BakeSettings, "bake", "Of `baker bake`, `baker ao` and `baker check`; of `baker.bake`, `baker.ao`."),
    (CheckSettings, "check", "Of `baker check`, beside those of the bake it is for; of `baker.check`."),
    (
        RepairSettings,
        "repair",
        "Of `baker check` with `--fix` or `--repair`; of `baker.repair`. On the command line, settings that"
        " a bake has, too, have the value of the bake.",
    ),
    (VerifySettings, "verify", "Of `baker verify`; of `baker.verify`."),
    (DiffSettings, "diff", "Of `baker diff`; of `baker.diff`."),
    (BatchSettings, "batch", "Of `baker batch`; of `baker.batch`. These have no keys in a file."),
    (RenderSettings, "render", "Of `baker render`; of `baker.render`."),
]

TABLE = """
| flag | key | value | unit | range | default | meaning |
|---|---|---|---|---|---|---|
"""

TAIL = """
## The configuration file

Keys of a bake are at the top level or in a table `[bake]`, those of other commands in a table named as the
section above; a dash in a key counts as an underscore:

```toml
resolution = 2048
quality = "high"
channels = ["irradiance", "ao"]
ao-distance = 0.5
sky = [0.4, 0.5, 0.7]
denoise = true

[check]
fail-on = "warning"

[verify]
texels = 5000
```

A key or table that does not exist ends the run with exit code 2 and the name of the nearest one that does.
"""


def rows(model: type[Settings]) -> list[str]:
    """Return a row of the table for each setting of a model."""
    found = []
    for name, field in model.model_fields.items():
        value = "true or false" if is_switch(field) else f"`{metavar_of(field)}`".replace("|", "\\|")
        default = f"`{default_of(field)}`" if default_of(field) else ""
        meaning = str(field.description).replace("|", "\\|")
        found.append(
            f"| `{flag_of(name, field)}` | `{name}` | {value} | {unit_of(field)} | {range_of(field)} "
            f"| {default} | {meaning} |"
        )
    return found


def page() -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for model, title, intro in SECTIONS:
        parts.append(f"\n## {title}\n\n{intro}\n{TABLE}" + "\n".join(rows(model)) + "\n")
    return "".join(parts) + TAIL


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        Path(__file__).with_name("SETTINGS.md").write_text(page(), "utf-8")
