"""The Typer applications that the command modules register with, and the options of the bare command."""

from __future__ import annotations

from typing import Annotated, Any, Final

import typer
from typer.core import TyperGroup

from airtruth.cli.failure import require_memory
from airtruth.cli.journal import Application, LogFile, Verbose, journal
from airtruth.cli.output import print_result
from airtruth.errors import ConfigurationError, choices

ORDER: Final = (
    "example",
    "new",
    "fly",
    "plan",
    "identify",
    "tables",
    "trace",
    "loop",
    "import",
    "check",
    "effects",
    "report",
    "export",
    "verify",
    "schema",
    "aircraft",
)
"""Order of the commands in --help: the order in which data passes through them; others follow."""


SYNONYMS: Final = {
    "simulate": "fly",
    "run": "fly",
    "campaign": "new campaign",
    "forecast": "plan",
    "predict": "plan",
    "estimate": "identify",
    "fit": "identify",
    "regress": "identify",
    "diagnose": "trace",
    "explain": "trace",
    "convert": "import",
    "load": "import",
    "validate": "check",
    "inspect": "check",
    "plot": "report",
    "html": "report",
    "init": "new",
    "create": "new",
    "template": "new",
    "examples": "example",
    "demo": "example",
    "list": "example",
    "library": "effects",
    "help": "--help",
    "version": "--version",
    "completion": "--install-completion",
}
"""Names of other programs for what a command does -> the command (judgement)."""


class _StreamOrder(TyperGroup):
    """Lists the commands in `ORDER`, whatever the order of the imports, and names the command for a wrong word."""

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command.

        Raises
        ------
        ConfigurationError
            Naming the right command.
        """
        known = super().get_command(ctx, cmd_name)
        if known is not None or ctx.resilient_parsing:  # a shell completes a word
            return known
        meant = SYNONYMS.get(cmd_name.lower()) if ctx.parent is None else None
        hint = f"`airtruth {meant}` does that; " if meant else ""
        raise ConfigurationError(
            f"command {cmd_name!r} does not exist; {hint}{choices(cmd_name, self.commands)}; "
            f"`{ctx.command_path} --help` explains each"
        )

    def list_commands(self, ctx: object) -> list[str]:
        """Names of the commands, those of `ORDER` first."""
        known = {name: index for index, name in enumerate(ORDER)}
        return sorted(self.commands, key=lambda name: known.get(name, len(known)))


app = Application(
    name="airtruth",
    help="Fly a flight test in JSBSim, identify the aircraft from its logs, close the loop with measured data.",
    cls=_StreamOrder,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
"""The command `airtruth`."""

aircraft_app = Application(
    help="Write a JSBSim aircraft from estimated or declared derivatives.",
    cls=_StreamOrder,
    no_args_is_help=True,
    rich_markup_mode=None,
)
"""The group `airtruth aircraft`."""
new_app = Application(
    help="Write a commented file to start from, which works as written.",
    cls=_StreamOrder,
    no_args_is_help=True,
    rich_markup_mode=None,
)
"""The group `airtruth new`."""
app.add_typer(aircraft_app, name="aircraft")
app.add_typer(new_app, name="new")


@app.callback(invoke_without_command=True)
def _root(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", "-V", help="Print the version.")] = False,
    verbose: Verbose = False,
    log_file: LogFile = None,
) -> None:
    ctx.with_resource(journal(verbose, log_file))
    if version:
        from airtruth import __version__

        print_result(__version__)
        raise typer.Exit
    require_memory()
