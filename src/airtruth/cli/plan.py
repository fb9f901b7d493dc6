"""`airtruth plan`: standard errors of a campaign beforehand, and the flight that answers a question best."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import Json, MotionName, PlanPressure, Quiet, Replace
from airtruth.cli.completion import complete_aircraft, complete_derivative, complete_effect
from airtruth.cli.early import require_file, require_names
from airtruth.cli.output import print_result
from airtruth.cli.progress import loading, progress_bar, status
from airtruth.errors import ConfigurationError
from airtruth.units import DEG

if TYPE_CHECKING:
    from airtruth.design import ForecastResult, Limits

_OF_INPUT: Final = (
    "size",
    "aircraft",
    "amplitude_deg",
    "rate_deg_s",
    "alpha_deg",
    "load_factor",
    "airspeed_percent",
    "length_s",
    "seed",
    "out",
    "force",
)
"""Parameters that apply to a computed input alone."""
_OF_PREDICTION: Final = ("pressure",)
"""Those that apply to a predicted accuracy alone."""


@app.command(
    epilog="Example: airtruth plan --split elevator_delay,actuator_lag --aircraft gtm --out next.toml"
)
def plan(
    context: typer.Context,
    campaign: Annotated[
        Path | None,
        typer.Argument(
            metavar="[CAMPAIGN.toml]",
            help="Campaign whose accuracy is predicted; otherwise the source of condition, gusts and sensors.",
        ),
    ] = None,
    records: Annotated[
        int | None,
        typer.Option(
            min=1, help="Number of records; default: the file's runs, as many as separate the effects, or 6."
        ),
    ] = None,
    pressure: Annotated[
        PlanPressure,
        typer.Option(
            help="constant: the filter does not use the airspeed as a measurement; measured: it does."
        ),
    ] = "constant",
    motion: Annotated[
        MotionName | None,
        typer.Option(
            help="Motion of the accuracy or of the derivatives. Default: each of which the campaign moves a control, or that of "
            "the derivatives."
        ),
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(
            metavar="A,B",
            help="Effects to separate, as NAME or NAME:VARIANT.",
            autocompletion=complete_effect,
        ),
    ] = None,
    derivative: Annotated[
        str | None,
        typer.Option(
            metavar="NAME[,NAME]",
            help="Derivatives to determine with the smallest standard errors.",
            autocompletion=complete_derivative,
        ),
    ] = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="DIR|trace.json",
            help="Trace to plan the next flight for: it separates tied effects, or narrows an increment or a derivative.",
        ),
    ] = None,
    size: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT.PARAMETER=VALUE",
            help="Size to plan for, may be repeated; an effect without one imitates the first.",
        ),
    ] = None,
    aircraft: Annotated[
        str | None,
        typer.Option(
            metavar="A",
            help="Aircraft, instead of that of the campaign or trace.",
            autocompletion=complete_aircraft,
        ),
    ] = None,
    amplitude_deg: Annotated[
        float, typer.Option(help="Largest deviation of the surfaces from their trim [deg].")
    ] = 2.0,
    rate_deg_s: Annotated[
        float | None, typer.Option(help="Largest rate of the surface [deg/s]; default: that of the servo.")
    ] = None,
    alpha_deg: Annotated[
        float, typer.Option(help="Largest deviation of the angle of attack from its trim [deg].")
    ] = 6.0,
    load_factor: Annotated[
        str, typer.Option(metavar="LOW,HIGH", help="Lowest and highest normal load factor.")
    ] = "0,2",
    airspeed_percent: Annotated[float, typer.Option(help="Largest change of the airspeed [%].")] = 10.0,
    length_s: Annotated[float, typer.Option(help="Length of the input [s].")] = 8.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="Campaign file to write, with a figure FILE.png."),
    ] = None,
    force: Replace = False,
    json_: Json = False,
    quiet: Quiet = False,
) -> None:
    """Predict the standard errors of a campaign, or compute the flight that separates effects or determines derivatives."""
    import json

    with loading("plan", quiet):
        if campaign is not None:
            require_file(
                campaign,
                "file",
                "`airtruth new campaign --out FILE.toml` writes a campaign file to start from",
            )
        if trace is not None:
            require_file(trace, "folder", "`airtruth trace LOG --aircraft A --out DIR` writes it")
        require_names(aircraft=aircraft, effects=[] if split is None else _listed("--split", split))
        from airtruth.api.plans import base_campaign
        from airtruth.design import PlanOptions
        from airtruth.design.from_files import Request, planned_from

    predicts = split is None and derivative is None and trace is None
    _require_of(context, predicts)
    if predicts:
        if campaign is None:
            raise ConfigurationError(
                "plan: state a CAMPAIGN.toml, --split A,B, --derivative NAME or --from DIR"
            )
        forecasts = _forecasts(campaign, records, pressure, motion, quiet)
        print_result(_json(forecasts) if json_ else _text(forecasts))
        return
    _require_motion(motion, _listed("--derivative", derivative))
    stated = Request(
        _listed("--split", split), _sizes(size or []), _listed("--derivative", derivative), trace
    )
    limits = _limits(amplitude_deg, rate_deg_s, alpha_deg, load_factor, length_s, airspeed_percent)
    options = PlanOptions(limits, records, seed)
    with status("plan", quiet) as step:
        base = base_campaign(campaign, trace is not None, aircraft)
        result = planned_from(base, stated, aircraft, options, out, force=force, step=step)
    print_result(json.dumps(result.to_dict(), indent=1) if json_ else result.summary())


def _require_motion(motion: MotionName | None, derivatives: list[str]) -> None:
    """Refuse a motion that has not the derivatives."""
    from airtruth.physics.motion import MOTIONS

    if motion is None:
        return
    others = [name for name in derivatives if name not in MOTIONS[motion].parameters]
    if others:
        raise ConfigurationError(
            f"plan: --motion {motion} has no derivative {others[0]!r}; it has {', '.join(MOTIONS[motion].parameters)}"
        )


def _forecasts(
    campaign: Path, records: int | None, pressure: PlanPressure, motion: MotionName | None, quiet: bool
) -> list[ForecastResult]:
    """The accuracy of the motion, or of each of which the campaign moves a control."""
    from airtruth.design import forecast, moved_motions
    from airtruth.simulation.campaign.plan import make

    made = make(campaign)
    found = []
    for name in moved_motions(made.campaign) if motion is None else (motion,):
        with progress_bar("plan", "kinds of runs", quiet) as advance:
            found.append(forecast(made, records, pressure, advance, name))
    return found


def _json(forecasts: list[ForecastResult]) -> str:
    """One object, or one of each motion under its name."""
    import json

    objects = {one.motion: one.to_dict() for one in forecasts}
    return json.dumps(objects if len(forecasts) > 1 else objects[forecasts[0].motion], indent=1)


def _text(forecasts: list[ForecastResult]) -> str:
    """The tables, each under the heading of its motion where there are several."""
    from airtruth.physics.motion import MOTIONS

    if len(forecasts) == 1:
        return forecasts[0].summary()
    return "\n\n".join(f"{MOTIONS[one.motion].heading}\n{one.summary()}" for one in forecasts)


def _require_of(context: typer.Context, predicts: bool) -> None:
    """Refuse options that do not apply to a prediction, or to a computed input."""
    others = _OF_INPUT if predicts else _OF_PREDICTION
    stated = [
        f"--{name.replace('_', '-')}"
        for name in others
        if getattr(context.get_parameter_source(name), "name", "") == "COMMANDLINE"
    ]
    if stated:
        needs = (
            "a computed input: state --split, --derivative or --from" if predicts else "a predicted accuracy"
        )
        raise ConfigurationError(f"plan: {', '.join(stated)} applies to {needs}; or leave it out")


def _listed(option: str, text: str | None) -> list[str]:
    names = [] if text is None else [name.strip() for name in text.split(",") if name.strip()]
    if text is not None and not names:
        raise ConfigurationError(f"{option} {text!r}: states no name; write names with commas between them")
    return names


def _limits(
    amplitude_deg: float,
    rate_deg_s: float | None,
    alpha_deg: float,
    load_factor: str,
    length_s: float,
    airspeed_percent: float,
) -> Limits:
    from airtruth.design import Limits

    try:
        low, high = (float(part) for part in load_factor.split(","))
    except ValueError:
        raise ConfigurationError(f"--load-factor {load_factor!r}: write LOW,HIGH, such as 0,2") from None
    rate = math.inf if rate_deg_s is None else rate_deg_s * DEG
    return Limits(amplitude_deg * DEG, rate, alpha_deg * DEG, (low, high), length_s, 0.01 * airspeed_percent)


def _sizes(stated: list[str]) -> dict[str, float]:
    found = {}
    for text in stated:
        name, _, value = text.partition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            raise ConfigurationError(
                f"--size {text!r}: write EFFECT.PARAMETER=VALUE, such as elevator_delay.delay_ms=8"
            ) from None
    return found
