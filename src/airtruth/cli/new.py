"""`airtruth new` and `airtruth example`: commented files to start from, and the examples that come with airtruth."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from shlex import quote
from typing import Annotated, Any

import typer

from airtruth.cli.application import app, new_app
from airtruth.cli.arguments import Replace
from airtruth.cli.completion import complete_aircraft, complete_example
from airtruth.cli.output import print_result
from airtruth.errors import ConfigurationError

Out = Annotated[Path, typer.Option("--out", metavar="FILE.toml", help="File to write.")]


@new_app.command("campaign", epilog="Example: airtruth new campaign --out first.toml")
def campaign(
    out: Out,
    aircraft: Annotated[
        str,
        typer.Option(
            metavar="A",
            help="Shipped name (gtm, c172x, f16, T38), or folder with aircraft.toml.",
            autocompletion=complete_aircraft,
        ),
    ] = "gtm",
    eas_kt: Annotated[
        float | None,
        typer.Option(min=1.0, help="Equivalent airspeed [kt]; a shipped aircraft has a default."),
    ] = None,
    altitude_ft: Annotated[
        float | None, typer.Option(help="Altitude [ft]; a shipped aircraft has a default.")
    ] = None,
    force: Replace = False,
) -> None:
    """Write a commented campaign of six runs in light turbulence."""
    from airtruth.logs.names import name_of
    from airtruth.starting import campaign_text

    name = name_of(out)
    text = campaign_text(name, aircraft, eas_kt, altitude_ft)
    file = quote(str(out))
    _write(out, text, [f"airtruth plan {file}", f"airtruth fly {file} --out out/{name}"], force)


@new_app.command("mapping", epilog="Example: airtruth new mapping flight7.csv --out flight7.toml")
def mapping(
    out: Out,
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE]",
            help="Measured file whose columns are guessed; without it, a sample with every key.",
        ),
    ] = None,
    force: Replace = False,
) -> None:
    """Write a commented mapping: which column of a measured file is which channel."""
    from airtruth.importers import guess_mapping
    from airtruth.starting import mapping_text

    text = mapping_text() if file is None else guess_mapping(file)
    measured = "data/foreign/flight7.csv" if file is None else file
    log = Path(measured).with_suffix(".parquet").name
    steps = [] if file is not None else ["airtruth example csv"]
    command = f"airtruth import {quote(str(measured))} --mapping {quote(str(out))} --out {quote(log)}"
    _write(out, text, [*steps, command], force)


def _measure(text: str) -> Any:
    return typer.Option(help=text, rich_help_panel="Geometry of an aircraft without a JSBSim model")


@new_app.command("aircraft", epilog="Example: airtruth new aircraft --jsbsim c182 --out aircraft/mine")
def aircraft(
    context: typer.Context,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder of the aircraft; its name is the aircraft's.")
    ],
    jsbsim: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|PATH", help="JSBSim model: a name that JSBSim ships, an XML file, or its folder."
        ),
    ] = None,
    span_m: Annotated[float | None, _measure("Wing span [m].")] = None,
    wing_area_m2: Annotated[float | None, _measure("Wing area [m2].")] = None,
    chord_m: Annotated[float | None, _measure("Mean aerodynamic chord [m]; default: area over span.")] = None,
    tail_area_m2: Annotated[
        float | None, _measure("Area of the horizontal tail with its elevator [m2].")
    ] = None,
    tail_arm_m: Annotated[float | None, _measure("CG to the quarter chord of the tail [m].")] = None,
    tail_span_m: Annotated[
        float | None, _measure("Span of the tail [m]; default: an aspect ratio of 4.5.")
    ] = None,
    elevator_share: Annotated[
        float | None, _measure("Chord of the elevator over that of the tail; default: 0.35, all-moving: 1.")
    ] = None,
    cg: Annotated[
        float | None,
        _measure("CG behind the leading edge of the mean aerodynamic chord [chords]; default: 0.25."),
    ] = None,
    mass_kg: Annotated[float | None, _measure("Mass [kg].")] = None,
    inertia_kg_m2: Annotated[float | None, _measure("Pitch inertia about the CG [kg m2].")] = None,
    length_m: Annotated[
        float | None, _measure("Length of the fuselage [m], which estimates the inertia.")
    ] = None,
    force: Replace = False,
) -> None:
    """Write an aircraft: from a JSBSim model, from its geometry, or a commented aircraft.toml to fill in."""
    if out.suffix == ".toml" and out.name != "aircraft.toml":
        raise ConfigurationError(
            f"--out {out}: the file of an aircraft is aircraft.toml in a folder of its own; state the folder, for example "
            f"--out {quote(str(out.with_suffix('')))}"
        )
    if jsbsim is not None:
        from airtruth.simulation.foreign_aircraft import new_from_jsbsim

        print_result(new_from_jsbsim(jsbsim, out, force=force).summary())
        return
    from airtruth.logs.names import name_of
    from airtruth.starting import Measured, aircraft_text, proposed_aircraft

    known = Measured(**{f.name: context.params[f.name] for f in fields(Measured)})
    folder = out.parent if out.name == "aircraft.toml" else out
    file = folder / "aircraft.toml"
    steps = [
        f"airtruth check LOG.parquet --aircraft {quote(str(folder))}",
        f"airtruth trace LOG.parquet --aircraft {quote(str(folder))} --out out/{quote(folder.absolute().name)}",
    ]
    name = name_of(folder.absolute())
    if known.is_empty:
        _write(file, aircraft_text(name), steps, force)
        return
    proposal = proposed_aircraft(name, known)
    print_result(proposal.summary + "\n")
    _write(file, proposal.text, steps, force)


@app.command(epilog="Example: airtruth example vane")
def example(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[NAME]", help="Example to copy; without it, the list.", autocompletion=complete_example
        ),
    ] = None,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder of the copies.")] = Path(),
    force: Replace = False,
) -> None:
    """List the examples that come with airtruth, or copy one."""
    from airtruth.starting import EXAMPLES, copy_example

    if name is None:
        width = max(map(len, EXAMPLES))
        lines = [f"{entry.name:<{width}}  {entry.title}" for entry in EXAMPLES.values()]
        print_result("\n".join([*lines, "", "airtruth example NAME copies one into the working folder"]))
        return
    copies = copy_example(name, out, force=force)
    print_result("\n".join([*map(str, copies), *_next(EXAMPLES[name].commands)]))


def _write(file: Path, text: str, steps: list[str], force: bool) -> None:
    from airtruth.logs.atomic import make_folder, write_text
    from airtruth.logs.outputs import writing

    with writing("new", force=force) as outputs:
        outputs.require(file)
        make_folder(file.parent)
        write_text(file, text)
    print_result("\n".join([str(file), *_next(steps)]))


def _next(commands: list[str] | tuple[str, ...]) -> list[str]:
    return ["", "next:", *(f"  {command}" for command in commands)]
