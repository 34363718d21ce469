"""Defines the settings of a check.

The settings come from flags or keyword arguments, from the table `[check]` of a configuration file, and from
the scene's extras.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from baker.core.settings_model import Settings, Texts, setting

if TYPE_CHECKING:
    from baker.core.scene import Scene

# Default of the setting `mip`, a mip level; 0 is the page itself.
DEFAULT_MIP = 2


class CheckSettings(Settings):
    """Settings of a check. Values are validated when an object is created."""

    table: ClassVar[str] = "check"
    what: ClassVar[str] = "check setting"

    fail_on: Literal["warning", "error"] | None = setting(
        None, "Lowest severity that fails the check; default: the scene's extras, else error."
    )
    ignore: Texts = setting(
        (), "Findings to ignore; `*` matches any characters. Repeatable.",
        metavar="CODE[@OBJECT]", repeated=True,
    )  # fmt: skip
    mip: int = setting(
        DEFAULT_MIP,
        "Coarsest mip level at which charts must not bleed into each other; 0 is the page.",
        ge=0,
        le=14,
    )
    rates: Path | None = setting(
        None,
        "Folder of an earlier bake whose speed is used to estimate time;"
        " default: the latest bake of the scene in a folder beside it.",
        metavar="OUT",
    )
    cost: bool = setting(
        False, "Estimate time and memory of a bake; measures the speed of rays for about a second."
    )


def with_extras(settings: CheckSettings, scene: Scene) -> CheckSettings:
    """Add the settings in `extras.baker.check` of the document to settings of a check.

    The extras may contain `ignore` and `fail_on`. `fail_on` is used only if `settings` has none.
    `ignored_by_nodes` reads the extras of nodes.

    Parameters
    ----------
    settings : CheckSettings
        Settings from flags and files.
    scene : Scene
        The scene whose extras are read.

    Returns
    -------
    CheckSettings
        The settings with the extras added.

    Raises
    ------
    SettingsError
        If the extras have a wrong value.
    """
    if scene.source is None:
        return settings
    own = check_extras(scene.source.json)
    found = CheckSettings.make(
        {key: value for key, value in own.items() if key in ("fail_on", "fail-on", "ignore")},
        file=f"{scene.path}: extras.baker.check",
    )
    rules = (*settings.ignore, *found.ignore)
    return settings.changed(ignore=rules, fail_on=settings.fail_on or found.fail_on)


def check_extras(holder: Any) -> dict[str, Any]:
    """Return `extras.baker.check` of a glTF object, an empty dictionary if it is missing."""
    for key in ("extras", "baker", "check"):
        holder = holder.get(key) if isinstance(holder, dict) else None
    return holder if isinstance(holder, dict) else {}
