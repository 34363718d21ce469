"""Writes the help of a command as text in two columns. Options are in groups, the common options first.

typer prints help as tables with a column for types. These tables leave little width for the descriptions if
the terminal is 80 characters wide. Therefore this module writes text with typer's plain formatter.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

# Title of the group of options that have no other group.
COMMON = "Common options"
# Titles of the two groups that are written last: options about the files to write, and about the run itself.
FILES, RUN = "Files", "Run"
# Number of options above which `--help` describes only the common options.
MANY = 30
# Largest width of the first column, characters. If a name is longer, its description begins on the next line.
_FIRST_COLUMN = 26


@dataclass
class Group:
    """Options with a common title.

    Attributes
    ----------
    title : str
        Title of the group.
    options : list
        The options, objects of typer.
    """

    title: str
    options: list[Any] = field(default_factory=list)


def groups_of(options: Sequence[Any], common: str) -> list[Group]:
    """Return the groups of the options of a command: `COMMON` first, `FILES` and `RUN` last.

    Parameters
    ----------
    options : sequence of typer options
        Options in the order of the help. The title of an option's group is `rich_help_panel`, None for
        `COMMON`.
    common : str
        Title of a further group whose options are put into `COMMON`.
    """
    groups = {title: Group(title) for title in (COMMON, FILES, RUN)}
    for option in options:
        title = option.rich_help_panel
        title = COMMON if title in (None, "", common) else title
        groups.setdefault(title, Group(title)).options.append(option)
    last = [groups.pop(title) for title in (FILES, RUN)]
    return [group for group in (*groups.values(), *last) if group.options]


def write_options(ctx: Any, formatter: Any, *, common: str = "", complete: bool = False) -> None:
    """Write the arguments and options of a command.

    Parameters
    ----------
    ctx : typer.Context
        Context of the command.
    formatter : HelpFormatter
        Receives the text.
    common : str
        Title of a further group whose options are put into `COMMON`.
    complete : bool
        Whether all options are described. Otherwise only the common options are described if there are more
        than `MANY` options.
    """
    params = ctx.command.get_params(ctx)
    arguments = [param for param in params if param.param_type_name == "argument"]
    options = [param for param in params if param.param_type_name == "option" and not param.hidden]
    if arguments:
        with formatter.section("Arguments"):
            _write(formatter, [(argument.metavar, argument.help or "") for argument in arguments])
    groups = groups_of(options, common)
    described = groups if complete or len(options) <= MANY else groups[:1]
    for group in described:
        with formatter.section(group.title if len(groups) > 1 else "Options"):
            _write(formatter, [(_names(option), _meaning(option)) for option in group.options])
    if len(described) < len(groups):
        with formatter.section(f"More options, described by `{ctx.command_path} --help-all`"):
            rest = [group for group in groups if group not in described]
            _write(formatter, [(group.title, " ".join(map(_flag, group.options))) for group in rest])


def usage_pieces(command: Any, ctx: Any) -> list[str]:
    """Return the words of the usage line: arguments, required options, and `[OPTIONS]`."""
    params = command.get_params(ctx)
    pieces = [str(param.metavar) for param in params if param.param_type_name == "argument"]
    required = [param for param in params if param.param_type_name == "option" and param.required]
    pieces += [f"{min(option.opts, key=len)} {option.metavar}" for option in required]
    return [*pieces, "[OPTIONS]"]


def _write(formatter: Any, rows: list[tuple[str, str]]) -> None:
    """Write two columns. The second column is wrapped here, because the formatter breaks flags at hyphens."""
    first = min(max(len(name) for name, _ in rows), _FIRST_COLUMN)
    width = formatter.width - first - 4
    # A line "\b" before a paragraph tells the formatter not to wrap this paragraph.
    wrapped = [
        (name, "\b\n" + textwrap.fill(text, width, break_on_hyphens=False) if text else "")
        for name, text in rows
    ]
    formatter.write_dl(wrapped, col_max=_FIRST_COLUMN)


def _flag(option: Any) -> str:
    """Return the long name of an option."""
    return str(max(option.opts, key=len))


def _names(option: Any) -> str:
    """Return the first column of an option: its names, and the placeholder of its value."""
    names = ", ".join(sorted([*option.opts, *option.secondary_opts], key=len))
    value = "" if option.is_flag or option.count else f" {option.metavar}"
    return names + value


def _meaning(option: Any) -> str:
    """Return the second column of an option."""
    help_text = str(option.help or "")
    return f"{help_text} (required)" if option.required else help_text
