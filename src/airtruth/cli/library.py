"""`airtruth effects`: the library of effects."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import Json, Replace
from airtruth.cli.output import print_result
from airtruth.errors import ConfigurationError


@app.command(epilog="Example: airtruth effects elevator_delay")
def effects(
    name: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Effects to show; without it, all.")
    ] = None,
    from_: Annotated[
        Path | None,
        typer.Option(
            "--from", metavar="DIR|trace.json", help="Write the increments that a trace learned as effects."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder of the package, with --from; default: learned_effects."),
    ] = None,
    json_: Json = False,
    force: Replace = False,
) -> None:
    """List and explain the effects that can be flown and traced, or write those that a trace learned."""
    if from_ is not None:
        if name or json_:
            raise ConfigurationError("--from writes what a trace learned; leave the names and --json out")
        _write(from_, out or Path("learned_effects"), force)
        return
    if out is not None:
        raise ConfigurationError("--out needs --from DIR: only learned increments are written")
    from airtruth.effects import listing
    from airtruth.effects import registry as library

    chosen = [e for n in name for e in library.listed(n)] if name else list(library.EFFECTS.values())
    print_result(listing.as_json(chosen) if json_ else listing.as_text(chosen))


def _write(answer: Path, out: Path, force: bool) -> None:
    from airtruth.logs.outputs import writing
    from airtruth.tracing.answer import TraceAnswer, answer_path
    from airtruth.tracing.effect_module import MODULE, write_effect_package

    names = (f"{MODULE}.py", "pyproject.toml")
    answer = answer_path(answer)
    with writing("effects", [answer], force=force) as outputs:
        outputs.require(*(out / name for name in names))
        write_effect_package(TraceAnswer.read(answer), out)
    print_result(
        f"{out / names[0]}: effects that a trace learned. `pip install {out}` adds them to the library; then "
        "`airtruth effects` lists them."
    )
