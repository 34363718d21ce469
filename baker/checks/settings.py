"""The settings of a check: from flags or keywords, the table `[check]` of a file, and the scene's extras."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from baker.core.settings_model import Settings, Texts, setting

if TYPE_CHECKING:
    from baker.core.scene import Scene

# Mip level of the lightmap down to which charts must not bleed into each other.
DEFAULT_MIP = 2


class CheckSettings(Settings):
    """Holds the settings of a check, checked."""

    table: ClassVar[str] = "check"
    what: ClassVar[str] = "check setting"

    fail_on: Literal["warning", "error"] | None = setting(
        None, "Least severity that fails the check; default: the scene's extras, else error."
    )
    ignore: Texts = setting(
        (), "Findings that do not count, with `*` for any letters; repeatable.",
        metavar="CODE[@OBJECT]", repeated=True,
    )  # fmt: skip
    mip: int = setting(DEFAULT_MIP, "Mip level at which charts must not mix.", ge=0, le=14)
    rates: Path | None = setting(
        None,
        "Estimate time with the speed of this earlier bake (else of one beside the scene).",
        metavar="OUT",
    )
    cost: bool = setting(False, "Estimate time and memory of a bake; measures ray rates for about a second.")


def with_extras(settings: CheckSettings, scene: Scene) -> CheckSettings:
    """Return settings to which the scene's own `extras.baker.check` is added.

    On the document: `fail_on` (unless `settings` has one) and `ignore`. On a node: `ignore`, a list of codes
    that do not count for that node, or true for all.

    Parameters
    ----------
    settings : CheckSettings
    scene : Scene

    Returns
    -------
    CheckSettings

    Raises
    ------
    SettingsError
        For a wrong value in the extras.
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
    """Return `extras.baker.check` of a glTF object, empty if it is not there."""
    for key in ("extras", "baker", "check"):
        holder = holder.get(key) if isinstance(holder, dict) else None
    return holder if isinstance(holder, dict) else {}


def _literal(name: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)
