"""`airtruth aircraft new`: a JSBSim aircraft from six derivatives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from airtruth.cli.application import aircraft_app
from airtruth.cli.output import print_result


@aircraft_app.command(
    "new",
    epilog="Example: airtruth aircraft new my_aircraft --estimates estimates.parquet --log a.parquet --out my_model",
)
def new(
    aircraft: Annotated[
        str, typer.Argument(metavar="A", help="Folder with aircraft.toml, or a shipped name.")
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write; its name is the aircraft's.")],
    estimates: Annotated[
        Path | None, typer.Option(help="Estimates of `airtruth identify`, instead of [derivatives].")
    ] = None,
    method: Annotated[
        str | None, typer.Option(metavar="NAME", help="Method whose estimates are used.")
    ] = None,
    late_ms: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="Undeclared delay of the elevator that the standard deviations of the estimates allow for [ms]; 0 if the "
            "surface itself is measured.",
        ),
    ] = 50.0,
    derivative: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Derivative that replaces the estimated or declared one; may be repeated.",
        ),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(help="Flight log whose first second is the trim, instead of the options below."),
    ] = None,
    airspeed_m_s: Annotated[float | None, typer.Option(help="True airspeed of the trim [m/s].")] = None,
    altitude_m: Annotated[float | None, typer.Option(help="Pressure altitude of the trim [m].")] = None,
    alpha_deg: Annotated[float, typer.Option(help="Angle of attack of the trim [deg].")] = 3.0,
    elevator_deg: Annotated[float, typer.Option(help="Elevator of the trim [deg].")] = 0.0,
) -> None:
    """Write a JSBSim aircraft with six derivatives about a trim, for an aircraft without a JSBSim model."""
    from airtruth.simulation import new_aircraft as creation

    at = (
        creation.logged_trim(log)
        if log is not None
        else creation.stated_trim(airspeed_m_s, altitude_m, alpha_deg, elevator_deg)
    )
    derivatives = {} if estimates is None else creation.estimated_derivatives(estimates, method)
    if derivatives and late_ms:
        widened = creation.allowing_for_delay(aircraft, derivatives, at, 1e-3 * late_ms)
        derivatives = widened.derivatives
        print_result(widened.sentence)
    derivatives |= dict(creation.stated_derivative(text) for text in derivative or [])
    print_result(creation.new_aircraft(aircraft, out, at, derivatives).summary())
