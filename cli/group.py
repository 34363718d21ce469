"""Defines the group of all subcommands, which imports the module of a subcommand only when it runs."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from baker.cli.commands import COMMANDS
from baker.cli.help import write_options
from baker.core.version import VERSION

if TYPE_CHECKING:
    from baker.cli.session import Session


class LazyGroup(TyperGroup):
    """The group of subcommands. It imports only the module of the subcommand that runs."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the subcommands in the order of `COMMANDS`."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import and return a subcommand; return a placeholder while a shell completes a name."""
        if cmd_name not in COMMANDS:
            return None
        if self._listing:
            return self.commands[cmd_name]
        return getattr(importlib.import_module(f"baker.cli.{cmd_name}"), cmd_name)()

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments before the subcommand; `help COMMAND` is read as `COMMAND --help`."""
        return super().parse_args(ctx, [*args[1:], "--help"] if args[:1] == ["help"] else args)

    _listing = False

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Return the words that complete a subcommand, without importing any subcommand."""
        self._listing = True
        return super().shell_complete(ctx, incomplete)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options and the subcommands of the help, without importing any subcommand."""
        write_options(ctx, formatter)
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def make_app() -> Any:
    """Return the command `baker` with all its subcommands."""
    app = typer.Typer(
        cls=LazyGroup,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
        epilog="`baker help COMMAND` or `baker COMMAND --help` describes a command.",
    )
    app.callback(invoke_without_command=True)(_root)
    group = typer.main.get_command(app)
    for name, summary in COMMANDS.items():
        group.add_command(TyperCommand(name=name, help=summary))  # type: ignore[attr-defined]
    return group


def _root(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", "-V", help="Print the version and exit.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Radiosity lightmaps and ambient occlusion for game assets, on a CPU."""
    session: Session = ctx.obj
    session.as_json = as_json
    if version:
        if as_json:
            session.write_json({"version": VERSION})
        else:
            session.out.write(f"baker {VERSION}\n")
        raise typer.Exit
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())
