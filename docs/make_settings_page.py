"""Writes SETTINGS.md from the settings themselves.

python docs/make_settings_page.py            writes the page
python docs/make_settings_page.py --print    prints it instead
"""

from __future__ import annotations

import sys
from pathlib import Path

from baker.cli.options import default_of, is_switch, metavar_of, range_of
from baker.core.settings import BakeSettings

HEAD = """\
# Settings

Every setting of a bake: as flag of `baker bake` and `baker ao`, as key of the file given with `--config`,
and as keyword of `baker.bake`. The command line wins over the file, the file over the default.
This page is made from the code by `docs/make_settings_page.py`.

| flag | key | value | range | default | meaning |
|---|---|---|---|---|---|
"""

TAIL = """
In a configuration file the keys stand at the top or in a table `[bake]`; a dash in a key counts as an
underscore:

```toml
resolution = 2048
quality = "high"
channels = ["irradiance", "ao"]
ao-distance = 0.5
sky = [0.4, 0.5, 0.7]
denoise = true
```

A key that does not exist ends the run with exit code 2 and the name of the nearest one that does.
"""


def page() -> str:
    """Return the text of the page."""
    rows = []
    for name, field in BakeSettings.model_fields.items():
        dashed = name.replace("_", "-")
        shown = f"--{dashed}/--no-{dashed}" if is_switch(field) else f"--{dashed}"
        value = "true or false" if is_switch(field) else f"`{metavar_of(field)}`".replace("|", "\\|")
        default = f"`{default_of(field)}`" if default_of(field) else ""
        rows.append(
            f"| `{shown}` | `{name}` | {value} | {range_of(field)} | {default} | {field.description} |"
        )
    return HEAD + "\n".join(rows) + "\n" + TAIL


if __name__ == "__main__":
    if "--print" in sys.argv[1:]:
        sys.stdout.write(page())
    else:
        Path(__file__).with_name("SETTINGS.md").write_text(page(), "utf-8")
