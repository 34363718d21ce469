"""Describes the fields of settings models for the help and the docs: ranges, defaults, placeholders."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal, get_args, get_origin

# `field` is a pydantic FieldInfo. It is annotated as Any, because only `baker.core.settings_model` imports
# pydantic.


def _extra(field: Any, key: str) -> Any:
    return (field.json_schema_extra or {}).get(key)


def range_of(field: Any) -> str:
    """Return the range of a setting as text, such as "1 to 10" or "above 0"; empty if it has none."""
    bound = {}
    for item in field.metadata:
        bound.update({key: getattr(item, key) for key in ("ge", "gt", "le", "lt") if hasattr(item, key)})
    if "ge" in bound and "le" in bound:
        return f"{bound['ge']} to {bound['le']}"
    words = {"ge": "from", "gt": "above", "le": "up to", "lt": "below"}
    return ", ".join(f"{words[key]} {value}" for key, value in bound.items())


def default_of(field: Any) -> str:
    """Return the default of a setting as text, "on" or "off" for switches; empty for None and empty lists."""
    value = field.default
    if value is None:
        return ""
    if isinstance(value, tuple):
        return ",".join(str(part) for part in value)
    if isinstance(value, bool):
        return "on" if value else "off"
    return str(value)


def unit_of(field: Any) -> str:
    """Return the unit of a setting, empty if it has none."""
    return _extra(field, "unit") or ""


def group_of(field: Any) -> str:
    """Return the title of a setting's group in the help, empty for the common options of a command."""
    return _extra(field, "group") or ""


def kinds_of(field: Any) -> list[Any]:
    """Return the types that the value of a setting may have, without None; for a Literal, the choices."""
    kinds: list[Any] = []
    stack = [field.annotation]
    while stack:
        kind = stack.pop(0)
        origin = get_origin(kind)
        if origin is Literal:
            kinds += get_args(kind)
        elif origin is tuple:
            kinds.append(tuple)
        elif hasattr(kind, "__metadata__"):  # Annotated
            stack.insert(0, kind.__origin__)
        elif get_args(kind):  # a union
            stack = [*get_args(kind), *stack]
        elif kind is not type(None):
            kinds.append(kind)
    return kinds


def choices_of(field: Any) -> list[str]:
    """Return the choices of a setting whose type is a Literal, else an empty list."""
    return [kind for kind in kinds_of(field) if isinstance(kind, str)]


def metavar_of(field: Any) -> str:
    """Return the placeholder for the value of a setting in the help, such as `N`, `a|b` or `TEXT`."""
    metavar = _extra(field, "metavar")
    if metavar:
        return str(metavar)
    kinds = kinds_of(field)
    if isinstance(kinds[0], str):
        return "|".join(kinds)
    if kinds[0] is tuple:
        return "NAME,..."
    return {int: "N", float: "NUMBER", Path: "PATH"}.get(kinds[0], "TEXT")


def is_switch(field: Any) -> bool:
    """Return whether a setting is a switch, which is on or off."""
    return kinds_of(field) == [bool]


def is_repeated(field: Any) -> bool:
    """Return whether the flag of a setting may be given several times."""
    return bool(_extra(field, "repeated"))


def flag_of(name: str, field: Any) -> str:
    """Return the flag of a setting. A switch that is on by default also has a flag that turns it off."""
    from baker.cli.flags import dashed

    flag = dashed(name)
    return f"--{flag}/--no-{flag}" if is_switch(field) and field.default else f"--{flag}"


def help_of(field: Any) -> str:
    """Return the help of a setting's flag: its description, with range and default in brackets."""
    from baker.cli.flags import in_flags

    shown = "" if is_switch(field) and not field.default else default_of(field)
    remarks = [range_of(field), f"default {shown}" if shown else ""]
    remark = "; ".join(filter(None, remarks))
    text = in_flags(field.description)
    return f"{text} ({remark})" if remark else text
