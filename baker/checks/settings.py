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
    """Add the settings in the scene's `extras.baker.check` to settings of a check.

    The extras of the document may have `ignore` and `fail_on`. `fail_on` is used only if `settings` has none.
    The extras of a node with a mesh may have `ignore`: a code, a list of codes, or true for all codes. These
    codes are ignored for all objects with the name of the node. The extras of nodes are read only if the
    scene was loaded with `lenient=True`.

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
    document = scene.source.json
    own = _table(document)
    rules = list(settings.ignore)
    found = CheckSettings.make(
        {key: value for key, value in own.items() if key in ("fail_on", "fail-on", "ignore")},
        file=f"{scene.path}: extras.baker.check",
    )
    rules += found.ignore
    nodes = document.get("nodes", [])
    for instance in scene.source_scene.instances if scene.source_scene is not None else ():
        table = _table(nodes[instance.node]) if instance.node < len(nodes) else {}
        codes = table.get("ignore", [])
        codes = ["*"] if codes is True else [codes] if isinstance(codes, str) else codes
        rules += [f"{code}@{_literal(instance.name)}" for code in codes if isinstance(code, str)]
    return settings.changed(ignore=tuple(rules), fail_on=settings.fail_on or found.fail_on)


def _table(holder: Any) -> dict[str, Any]:
    """Return `extras.baker.check` of a glTF object, an empty dictionary if it is missing."""
    for key in ("extras", "baker", "check"):
        holder = holder.get(key) if isinstance(holder, dict) else None
    return holder if isinstance(holder, dict) else {}


def _literal(name: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)
