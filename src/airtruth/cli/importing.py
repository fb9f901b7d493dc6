"""`airtruth import`: measured logs of other formats, cut, merged and converted."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import Quiet
from airtruth.cli.early import require_file
from airtruth.cli.output import notice, print_result
from airtruth.cli.progress import loading, working


@app.command(
    name="import", epilog="Example: airtruth import flight7.mat --mapping flight7.toml --out flight7.parquet"
)
def import_(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help=".csv, .txt (.dat, .asc), .mat, .parquet, .ulg, .bin, .mf4 (.mdf) or .h5 (.hdf5, .hdf); "
            "several files become one log.",
        ),
    ],
    mapping: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="MAP.toml",
            help="Which column is which channel, see docs/measured.md. One for each file merges recorders of one flight.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="LOG.parquet", help="Flight log to write, or TABLE.csv of --find-manoeuvres."),
    ] = None,
    guess: Annotated[
        bool, typer.Option("--guess", help="Print a mapping to start from, import nothing.")
    ] = False,
    dictionary: Annotated[
        Path | None,
        typer.Option(metavar="WORDS.toml", help="Further names and units of columns for --guess."),
    ] = None,
    find_manoeuvres: Annotated[
        bool,
        typer.Option(
            "--find-manoeuvres",
            help="Write a table of start and stop times, and a picture, to accept or edit.",
        ),
    ] = False,
    manoeuvres: Annotated[
        Path | None,
        typer.Option(metavar="TABLE.csv", help="Table of start and stop times; each row becomes a run."),
    ] = None,
    force: Annotated[
        bool,
        typer.Option(
            "--force",
            help="Write the log although its mapping contradicts physics, and replace a file that import did not write.",
        ),
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Convert measured logs of other formats to a flight log."""
    from airtruth.errors import ConfigurationError, counted

    if guess and len(files) > 1:
        raise ConfigurationError("--guess proposes a mapping for one file; run it once for each file")
    if not guess and (mapping is None or out is None):
        raise ConfigurationError(
            "import needs --mapping MAP.toml and --out LOG.parquet; "
            f"`airtruth import --guess {quote(str(files[0]))}` prints a mapping to start from"
        )
    with loading("import", quiet):
        for file in files:
            require_file(file, "file", "give the measured log")
        from airtruth import importers

    if guess:
        words = importers.read_dictionary(dictionary) if dictionary else None
        print_result(importers.guess_mapping(files[0], words=words), end="")
        return
    assert mapping is not None
    assert out is not None
    if find_manoeuvres:
        _find(files, mapping, out, force=force, quiet=quiet)
        return
    from airtruth.logs.outputs import writing
    from airtruth.logs.store import write_log

    inputs = [*files, *mapping, *([manoeuvres] if manoeuvres else [])]
    with working("import", quiet), writing("import", inputs, force=force) as outputs:
        outputs.require(out)
        imported = importers.import_log(files, mapping, manoeuvres=manoeuvres, force=force)
        write_log(out, imported.log, dtype="float64")
    for sentence in (*imported.notes, *(fault.sentence for fault in imported.faults)):
        notice(sentence)
    log = imported.log
    print_result(
        f"{counted(len(log.run_ids), 'run')}, {len(log.t_s)} rows in {out}: {', '.join(log.channels)}"
    )


def _find(files: list[Path], mapping: list[Path], out: Path, *, force: bool, quiet: bool) -> None:
    """Write the table of manoeuvres and its picture, and print a summary."""
    from airtruth.api import find_manoeuvres

    with working("import", quiet):
        found = find_manoeuvres(files, mapping, out=out, force=force)
    print_result(
        f"{found.summary()}\n{out} and {out.with_suffix('.png')}: edit the table, then import with --manoeuvres {quote(str(out))}"
    )


__all__ = ["import_"]
