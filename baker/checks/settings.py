"""Settings of a check: from the command line, the `[check]` table of a TOML file, and the scene's extras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from baker.checks.context import DEFAULT_MIP
from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.core.scene import Scene

LIMITS = ("warning", "error")


@dataclass(frozen=True)
class CheckSettings:
    """How a check judges.

    Attributes
    ----------
    fail_on : str or None
        "warning" or "error": the least severity that fails the check. None leaves it to the scene's extras,
        which without a word mean "error".
    ignore : tuple of str
        Findings that do not count: CODE or CODE@OBJECT; both may hold `*`.
    mip : int
        Mip level of the lightmap down to which charts must not bleed into each other, 0 to 14.
    rates : str or None
        Folder of an earlier bake with whose speed the time is reckoned.
    cost : bool
        Measure for a second how fast rays are, if `rates` does not say.
    """

    fail_on: str | None = None
    ignore: tuple[str, ...] = ()
    mip: int = DEFAULT_MIP
    rates: str | None = None
    cost: bool = False


def make_check_settings(values: Mapping[str, Any], *, where: str = "") -> CheckSettings:
    """Check values and return settings.

    Parameters
    ----------
    values : mapping
        Names of `CheckSettings`; a dash counts as an underscore.
    where : str
        The file that they come from, for messages.

    Raises
    ------
    SettingsError
        For an unknown name, with the nearest known one, or a wrong value.
    """

    def fail(message: str, key: str) -> SettingsError:
        return SettingsError(message, file=where or None, object=key)

    known = [field.name for field in fields(CheckSettings)]
    clean: dict[str, Any] = {}
    for key, value in values.items():
        name = key.replace("-", "_")
        if name not in known:
            raise unknown_name("check setting", key, known, file=where or None, object=key)
        clean[name] = value
    limit, ignore = clean.get("fail_on"), clean.get("ignore", ())
    if limit is not None and limit not in LIMITS:
        raise fail(f"fail_on is {limit!r}, neither 'warning' nor 'error'", "fail_on")
    ignore = [ignore] if isinstance(ignore, str) else ignore
    if not isinstance(ignore, list | tuple) or not all(isinstance(rule, str) for rule in ignore):
        raise fail("ignore must be a list of texts like 'open-edges@Wall'", "ignore")
    mip = clean.get("mip", DEFAULT_MIP)
    if not isinstance(mip, int) or isinstance(mip, bool) or not 0 <= mip <= 14:
        raise fail(f"mip is {mip!r}, not a whole number from 0 to 14", "mip")
    rates = clean.get("rates")
    if rates is not None and not isinstance(rates, str):
        raise fail("rates must name the folder of a bake", "rates")
    cost = clean.get("cost", False)
    if not isinstance(cost, bool):
        raise fail(f"cost is {cost!r}, neither true nor false", "cost")
    return CheckSettings(limit, tuple(ignore), mip, rates, cost)


def with_extras(settings: CheckSettings, scene: Scene) -> CheckSettings:
    """Return settings with what the scene's own `extras.baker.check` says added.

    On the document: `fail_on` (if nobody else says it) and `ignore`. On a node: `ignore`, a list of codes
    that do not count for that node, or true for all.
    """
    if scene.source is None:
        return settings
    document = scene.source.json
    own = _table(document)
    rules = list(settings.ignore)
    found = make_check_settings(
        {key: value for key, value in own.items() if key in ("fail_on", "fail-on", "ignore")},
        where=f"{scene.path}: extras.baker.check",
    )
    rules += found.ignore
    nodes = document.get("nodes", [])
    for instance in scene.source_scene.instances if scene.source_scene is not None else ():
        table = _table(nodes[instance.node]) if instance.node < len(nodes) else {}
        codes = table.get("ignore", [])
        codes = ["*"] if codes is True else [codes] if isinstance(codes, str) else codes
        rules += [f"{code}@{_literal(instance.name)}" for code in codes if isinstance(code, str)]
    return replace(settings, ignore=tuple(rules), fail_on=settings.fail_on or found.fail_on)


def _table(holder: Any) -> dict[str, Any]:
    """Return `extras.baker.check` of a glTF object, empty if it is not there."""
    for key in ("extras", "baker", "check"):
        holder = holder.get(key) if isinstance(holder, dict) else None
    return holder if isinstance(holder, dict) else {}


def _literal(name: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)
