"""Defines the decorator of subcommands, which adds flags for settings and combines settings from sources."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO, TypeVar, cast

import typer
from typer.core import TyperCommand

from baker.cli.commands import COMMANDS
from baker.cli.fields import choices_of, flag_of, group_of, help_of, is_repeated, is_switch, metavar_of
from baker.cli.flags import FlagStream
from baker.cli.help import RUN, usage_pieces, write_options
from baker.cli.outputs import check_paths
from baker.core.errors import SettingsError
from baker.core.settings_model import Settings
from baker.core.stage import Stage

if TYPE_CHECKING:
    from baker.cli.progress import Reporter
    from baker.cli.session import Session

_S = TypeVar("_S", bound=Settings)


@dataclass
class Run:
    """One parsed command line. A subcommand receives it as `ctx.obj`.

    Attributes
    ----------
    session : Session
    as_json, quiet : bool
        Whether `--json` and `--quiet` were given.
    verbose : int
        How often `--verbose` was given.
    given : dict
        Settings that were given on the command line, by name.
    settings : dict
        Settings by model, combined from defaults, configuration file and command line.
    """

    session: Session
    as_json: bool
    quiet: bool
    verbose: int
    given: dict[str, Any]
    settings: dict[type[Settings], Settings]

    def of(self, model: type[_S]) -> _S:
        """Return the settings of the class `model`."""
        return cast("_S", self.settings[model])

    @contextmanager
    def progress(self) -> Iterator[Reporter]:
        """Show progress during the `with` statement, first the stage "start", because imports are slow."""
        with self.session.reporter(quiet=self.quiet) as reporter:
            reporter(Stage.START, 0.0)
            yield reporter

    @property
    def text(self) -> TextIO:
        """Return the stream for text output. It converts names of settings to flags."""
        return cast("TextIO", FlagStream(self.session.text_stream(as_json=self.as_json)))


# Flags that every subcommand has.
_COMMON: list[tuple[str, Any, Any]] = [
    (
        "as_json",
        Annotated[
            bool,
            typer.Option(
                "--json", help="One JSON object on stdout; text goes to stderr.", rich_help_panel=RUN
            ),
        ],
        False,
    ),
    (
        "quiet",
        Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.", rich_help_panel=RUN)],
        False,
    ),
    (
        "verbose",
        Annotated[
            int,
            typer.Option(
                "--verbose",
                "-v",
                count=True,
                show_default=False,
                help="Print more; -vv shows tracebacks.",
                rich_help_panel=RUN,
            ),
        ],
        0,
    ),
]
_CONFIG = Annotated[
    Path | None,
    typer.Option("--config", metavar="FILE", help="TOML file of settings.", rich_help_panel=RUN),
]
# A flag of every subcommand. `_SettingsCommand.parse_args` reads it.
_HELP_ALL = Annotated[bool, typer.Option("--help-all", help="Describe all options and exit.")]

# The flag `--cluster`, for subcommands that can use more than one machine.
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        help="Work on a dask.distributed cluster: tcp://HOST:8786, or local:N for N processes here.",
        rich_help_panel=RUN,
    ),
]


def command(
    name: str, *models: type[Settings], fixed: dict[str, Any] | None = None, common: str = ""
) -> Callable[[Callable[..., None]], Callable[[], Any]]:
    """Return a decorator that makes a subcommand of a function with a typer signature.

    Parameters
    ----------
    name : str
        Name of the subcommand, as in `commands.COMMANDS`.
    *models : type of Settings
        Classes whose fields become flags. If two classes have a field with the same name, the flag is made
        from the field of the first class. If a configuration file can contain settings of one of the classes,
        the flag `--config` is added.
    fixed : dict, optional
        Settings with a fixed value. They have no flag.
    common : str
        Title of a group of settings that the help lists among the common options.

    Returns
    -------
    callable
        The decorator. It replaces the function by one that returns the subcommand. The subcommand calls the
        original function with a context, whose `obj` is a `Run`, and its further arguments.
    """
    fixed = fixed or {}

    def decorate(work: Callable[..., None]) -> Callable[[], Any]:
        def make() -> Any:
            app = typer.Typer(
                add_completion=False,
                rich_markup_mode=None,
                context_settings={"help_option_names": ["-h", "--help"]},
            )
            app.command(name, cls=_SettingsCommand, help=COMMANDS[name])(work)
            made = typer.main.get_command(app)
            assert isinstance(made, _SettingsCommand)
            made.add_settings(models, fixed)
            made.common = common
            return made

        return make

    return decorate


class _SettingsCommand(TyperCommand):
    """A subcommand that has flags for settings in addition to its own arguments."""

    models: tuple[type[Settings], ...] = ()
    fixed: dict[str, Any]
    common: str = ""
    _help_all = False

    def add_settings(self, models: tuple[type[Settings], ...], fixed: dict[str, Any]) -> None:
        """Append flags for the fields of `models` that are not in `fixed`, and flags of all subcommands."""
        self.models, self.fixed = models, fixed
        fields = {
            name: field
            for model in reversed(models)
            for name, field in model.model_fields.items()
            if name not in fixed
        }
        ordered = dict.fromkeys(name for model in models for name in model.model_fields if name in fields)
        flags: list[tuple[str, Any, Any]] = [
            ("config", _CONFIG, None) for _ in [0] if any(model.table for model in models)
        ]
        flags += [(name, _annotation(name, fields[name]), None) for name in ordered]
        # typer makes flags from a signature. Make a dataclass, because its signature consists of its fields.
        holder = make_dataclass("Flags", [*flags, *_COMMON, ("help_all", _HELP_ALL, False)], kw_only=True)
        app = typer.Typer(add_completion=False)
        app.command()(holder)
        self.params += typer.main.get_command(app).params
        self.flag_names = [name for name, _, _ in flags]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments, and refuse empty paths, because `Path("")` is the current folder."""
        if "--help-all" in args:
            self._help_all, args = True, ["--help"]
        paths = {
            flag
            for p in cast("list[Any]", self.params)
            if "Path" in str(p.type_descriptor.annotation)
            for flag in p.opts
        }
        for before, word in zip(["", *args], args, strict=False):
            flag = before if not word else word.removesuffix("=")
            if (not word and (before in paths or not before.startswith("-"))) or (word != flag in paths):
                name = f"{flag} is" if flag in paths else "an argument is"
                raise SettingsError(f"{name} empty; name a file or a folder ('.' is the current folder)")
        return super().parse_args(ctx, args)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words of the usage line."""
        return usage_pieces(self, ctx)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the options of the help."""
        write_options(ctx, formatter, common=self.common, complete=self._help_all)

    def invoke(self, ctx: Any) -> Any:
        """Combine settings from all sources, and call the function of the subcommand."""
        from baker.cli.config import resolve

        session: Session = ctx.obj
        values = ctx.params
        given = {name: values.pop(name, None) for name in self.flag_names}
        config = given.pop("config", None)
        values.pop("help_all")
        check_paths(str(self.name), values, config)
        given = {name: value for name, value in given.items() if value not in (None, [], ())}
        ctx.obj = Run(
            session=session,
            as_json=values.pop("as_json") or session.as_json,
            quiet=values.pop("quiet"),
            verbose=values.pop("verbose"),
            given=given,
            settings=resolve(self.models, {**given, **self.fixed}, config),
        )
        return super().invoke(ctx)


def _annotation(name: str, field: Any) -> Any:
    """Return the type annotation of a flag for typer. Values are text or None; the model validates them."""
    if is_switch(field):
        option = typer.Option(
            flag_of(name, field), help=help_of(field), show_default=False, rich_help_panel=group_of(field)
        )
        return Annotated[bool | None, option]
    option = typer.Option(
        flag_of(name, field),
        help=help_of(field),
        metavar=metavar_of(field),
        show_default=False,
        autocompletion=_completer(choices_of(field)),
        rich_help_panel=group_of(field),
    )
    return Annotated[list[str] | None if is_repeated(field) else str | None, option]


def _completer(choices: list[str]) -> Callable[[str], list[str]]:
    """Return the function with which a shell completes the value of a flag."""

    def complete(incomplete: str) -> list[str]:
        return [choice for choice in choices if choice.startswith(incomplete)]

    return complete
