"""Command-line flags, made from the settings so that the two cannot drift apart."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from typing import Annotated, Any, Literal, get_args, get_origin

import typer

KEYWORD = inspect.Parameter.KEYWORD_ONLY

# `field` below is a field of the settings model: its class is named in `core.settings` alone.


def flag(name: str, kind: Any, option: Any, default: Any = None) -> inspect.Parameter:
    """Return one parameter of a command, for its signature."""
    return inspect.Parameter(name, KEYWORD, default=default, annotation=Annotated[kind, option])


def common_flags() -> list[inspect.Parameter]:
    """Return the flags that every command takes, `--threads` and `--seed` aside."""
    return [
        flag(
            "as_json",
            bool,
            typer.Option("--json", help="One JSON object on stdout; text goes to stderr."),
            False,
        ),
        flag("quiet", bool, typer.Option("--quiet", "-q", help="Say nothing but errors."), False),
        flag(
            "verbose",
            int,
            typer.Option(
                "--verbose", "-v", count=True, show_default=False, help="Say more; -vv shows tracebacks."
            ),
            0,
        ),
    ]


def cluster_flag() -> inspect.Parameter:
    """Return `--cluster`, of the commands that can work on more than one machine."""
    text = "Work on a dask.distributed cluster: tcp://HOST:8786, or local:N for N processes here."
    return flag("cluster", str | None, typer.Option("--cluster", metavar="ADDRESS", help=text))


def setting_flags(
    *, only: Collection[str] | None = None, without: Collection[str] = ()
) -> list[inspect.Parameter]:
    """Return one flag for each setting.

    Parameters
    ----------
    only : collection of str or None
        Names of the settings wanted; None for all.
    without : collection of str
        Names of the settings left out.

    Notes
    -----
    A flag's value stays None where it is not given, so that the configuration file is heard; the text
    is checked by `make_settings`, in the same place as the file's.
    """
    from baker.core.settings import BakeSettings

    return [
        _setting_flag(name, field)
        for name, field in BakeSettings.model_fields.items()
        if (only is None or name in only) and name not in without
    ]


def range_of(field: Any) -> str:
    """Return a setting's range in words, empty if it has none."""
    bound = {}
    for item in field.metadata:
        bound.update({key: getattr(item, key) for key in ("ge", "gt", "le", "lt") if hasattr(item, key)})
    if "ge" in bound and "le" in bound:
        return f"{bound['ge']} to {bound['le']}"
    words = {"ge": "from", "gt": "above", "le": "up to", "lt": "below"}
    return ", ".join(f"{words[key]} {value}" for key, value in bound.items())


def default_of(field: Any) -> str:
    """Return a setting's default as one would type it, empty if it has none of its own."""
    value = field.default
    if value is None:
        return ""
    if isinstance(value, tuple):
        return ",".join(str(part) for part in value)
    if isinstance(value, bool):
        return "on" if value else "off"
    return str(value)


def metavar_of(field: Any) -> str:
    """Return what stands for a setting's value in the help: `N`, `X`, `a|b` or `TEXT`."""
    kinds = [kind for kind in get_args(field.annotation) or (field.annotation,) if kind is not type(None)]
    if get_origin(field.annotation) is Literal:
        return "|".join(str(kind) for kind in kinds)
    if get_origin(field.annotation) is tuple:
        return "NAME,..."
    return {int: "N", float: "X"}.get(kinds[0], "TEXT")


def is_switch(field: Any) -> bool:
    """Tell whether a setting is on or off."""
    return field.annotation is bool


def given(values: dict[str, Any]) -> dict[str, Any]:
    """Return the settings among a command's values that were on the command line."""
    from baker.core.settings import BakeSettings

    return {name: values[name] for name in BakeSettings.model_fields if values.get(name) not in (None, [])}


def build(name: str, summary: str, work: Callable[..., None], flags: list[inspect.Parameter]) -> Any:
    """Return a command of `work`, which is called with every flag as a keyword."""

    def call(**values: Any) -> None:
        work(**values)

    call.__signature__ = inspect.Signature(flags)  # type: ignore[attr-defined]
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in flags}
    app = typer.Typer(add_completion=False, context_settings={"help_option_names": ["-h", "--help"]})
    app.command(name, help=summary)(call)
    return typer.main.get_command(app)


def _setting_flag(name: str, field: Any) -> inspect.Parameter:
    from baker.core.settings import REPEATED

    dashed = name.replace("_", "-")
    remarks = [range_of(field), f"default {default_of(field)}" if default_of(field) else ""]
    remark = "; ".join(filter(None, remarks))
    text = f"{field.description} ({remark})" if remark else str(field.description)
    if is_switch(field):
        return flag(
            name, bool | None, typer.Option(f"--{dashed}/--no-{dashed}", help=text, show_default=False)
        )
    option = typer.Option(f"--{dashed}", help=text, metavar=metavar_of(field), show_default=False)
    if name in REPEATED:
        return flag(name, list[str] | None, option)
    return flag(name, str | None, option)
