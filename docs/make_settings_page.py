"""Writes SETTINGS.md from the settings classes, with a section for each command.

python docs/make_settings_page.py            writes the page
python docs/make_settings_page.py --print    prints it instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.checks.settings import CheckSettings
from baker.cli.fields import default_of, flag_of, is_switch, kinds_of, metavar_of, range_of, unit_of
from baker.comparison.settings import DiffSettings
from baker.core.object_settings import ObjectSettings
from baker.core.settings import BakeSettings
from baker.core.settings_model import Settings
from baker.jobs.settings import BatchSettings
from baker.rendering.settings import RenderSettings
from baker.repairs.settings import RepairSettings
from baker.verification.settings import VerifySettings

HEAD = """\
# Settings

Every setting is a flag of the command line and a keyword of the Python API. Except for the settings of
`baker batch`, it is also a key of the file given with `--config`. A flag overrides the file, and the file
overrides the default.
`docs/make_settings_page.py` generates this page from the code.
"""

SECTIONS: list[tuple[type[Settings], str, str]] = [
    (
        BakeSettings,
        "bake",
        "Settings of `baker bake`, `baker ao` and `baker check`, and of `baker.bake` and `baker.ao`.",
    ),
    (
        CheckSettings,
        "check",
        "Settings of `baker check`, in addition to those of a bake, and of `baker.check`.",
    ),
    (
        RepairSettings,
        "repair",
        "Settings of `baker check` with `--fix` or `--repair`, and of `baker.repair`. On the command line,"
        " a setting of this table that is also a setting of a bake is set by the flag of the bake.",
    ),
    (VerifySettings, "verify", "Settings of `baker verify` and `baker.verify`."),
    (DiffSettings, "diff", "Settings of `baker diff` and `baker.diff`."),
    (
        BatchSettings,
        "batch",
        "Settings of `baker batch` and `baker.batch`. They cannot be set in a configuration file.",
    ),
    (RenderSettings, "render", "Settings of `baker render` and `baker.render`."),
]

TABLE = """
| flag | key | value | unit | range | default | meaning |
|---|---|---|---|---|---|---|
"""

OBJECTS = """
## object

Keys of the setting `object`, of tables `[[object]]` in the configuration file, and of `extras.baker` in glTF
files. [OBJECTS.md](OBJECTS.md) describes where they may be set and which value wins.

| key | value | range | default | meaning |
|---|---|---|---|---|
"""

TAIL = """
## The configuration file

Settings of a bake are at the top level of the file or in a table `[bake]`. Settings of another command are in
a table with the name of its section above. Keys may have dashes instead of underscores:

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

An unknown key or table ends the run with exit code 2; the error suggests the nearest known name.
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


def object_rows() -> list[str]:
    """Return a row of the table for each setting of an object."""
    found = []
    for name, field in ObjectSettings.model_fields.items():
        value = "true or false" if bool in kinds_of(field) else f"`{metavar_of(field)}`".replace("|", "\\|")
        default = f"`{str(field.default).lower()}`" if field.default not in (None, "") else ""
        found.append(f"| `{name}` | {value} | {range_of(field)} | {default} | {field.description} |")
    return found


def page() -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for model, title, intro in SECTIONS:
        parts.append(f"\n## {title}\n\n{intro}\n{TABLE}" + "\n".join(rows(model)) + "\n")
    return "".join(parts) + OBJECTS + "\n".join(object_rows()) + "\n" + TAIL


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        Path(__file__).with_name("SETTINGS.md").write_text(page(), "utf-8")
