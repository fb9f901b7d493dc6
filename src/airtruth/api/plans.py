"""Public function that plans flights: the accuracy of a campaign, or the input that answers a question best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, overload

from airtruth.api.campaigns import campaign_of

if TYPE_CHECKING:
    from airtruth.api.arguments import FilePath
    from airtruth.design import ForecastResult, LateralPlan, LateralSplit, Limits, NarrowResult, SplitResult
    from airtruth.simulation.campaign.file import Campaign


@overload
def plan(
    campaign: FilePath | Campaign,
    *,
    records: int | None = None,
    pressure: str = "constant",
    motion: str | None = None,
) -> ForecastResult: ...


@overload
def plan(
    campaign: FilePath | Campaign | None = None,
    *,
    records: int | None = None,
    split: Sequence[str],
    sizes: Mapping[str, float] | None = None,
    aircraft: str | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    out: FilePath | None = None,
    force: bool = False,
) -> SplitResult | LateralSplit: ...


@overload
def plan(
    campaign: FilePath | Campaign | None = None,
    *,
    records: int | None = None,
    derivatives: Sequence[str],
    trace: FilePath | None = None,
    aircraft: str | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    out: FilePath | None = None,
    force: bool = False,
) -> NarrowResult | LateralPlan: ...


@overload
def plan(
    campaign: FilePath | Campaign | None = None,
    *,
    records: int | None = None,
    trace: FilePath,
    aircraft: str | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    out: FilePath | None = None,
    force: bool = False,
) -> SplitResult | NarrowResult | LateralPlan | LateralSplit: ...


def plan(
    campaign: FilePath | Campaign | None = None,
    *,
    records: int | None = None,
    pressure: str = "constant",
    motion: str | None = None,
    split: Sequence[str] = (),
    derivatives: Sequence[str] = (),
    trace: FilePath | None = None,
    sizes: Mapping[str, float] | None = None,
    aircraft: str | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    out: FilePath | None = None,
    force: bool = False,
) -> ForecastResult | SplitResult | NarrowResult | LateralPlan | LateralSplit:
    """Predict the standard errors of a campaign (Cramer-Rao bound), or compute the flight that answers a question best.

    Parameters
    ----------
    campaign : campaign file or a `Campaign`. To compute a flight it states aircraft, condition, gusts and sensors, and
        may be None: the condition is then that of the trace, or the default one of a shipped aircraft.
    records : number of records; None for the campaign's runs, as many as separate the effects with 95 % probability, or 6
        for derivatives and increments.
    pressure : "constant", the airspeed is not an output of the filter, or "measured", it is one.
    motion : "longitudinal" or "lateral", to predict; None for the first of which the campaign moves a control.
    split : keys of two or more effects to separate.
    derivatives : names of derivatives to determine with the smallest standard errors; a string is one of them.
    trace : folder of a trace, or its trace.json. Without ``split`` and ``derivatives`` its verdict decides: tied effects are
        separated, the band of a learned increment is narrowed.
    sizes : EFFECT.PARAMETER -> value [its unit]; an effect without sizes imitates the first.
    aircraft : shipped name or folder, instead of that of the campaign or of the trace.
    limits : of the elevator and of the motion.
    seed : seed of the search.
    out : campaign file to write, with a figure of the same name; None to write nothing.
    force : replace files that this command did not write or that changed since.

    Returns
    -------
    ForecastResult, SplitResult, NarrowResult, LateralPlan or LateralSplit
        The first of a campaign; the campaigns of the others, ``campaign``, can be flown.

    Raises
    ------
    ConfigurationError
        If an input cannot be used as written, or the trace leaves no question that an input answers.
    AircraftError, TrimError, FlightError, StoreError
        If the aircraft cannot be loaded, trimmed or flown, or a file cannot be read or written.

    Examples
    --------
    >>> forecast = at.plan("light.toml", records=6)
    >>> forecast.theta.shape, forecast.together.shape
    ((6,), (6,))
    """
    from airtruth.arguments import as_path, names, require_type
    from airtruth.design import Limits, PlanOptions, forecast
    from airtruth.errors import ConfigurationError

    require_type("limits", limits, Limits, "Limits")
    split, derivatives = names("split", split, "elevator_delay"), names("derivatives", derivatives, "Cmq")
    if not split and not derivatives and trace is None:
        if campaign is None:
            raise ConfigurationError(
                "plan: nothing to plan; give a campaign, effects to split, derivatives, or a trace"
            )
        if aircraft is not None or out is not None or limits is not None or sizes:
            raise ConfigurationError(
                "plan: aircraft, limits, sizes and out apply to a computed input: state split, derivatives or trace"
            )
        return forecast(campaign_of(campaign), records, pressure, motion=motion)
    if motion is not None:
        raise ConfigurationError("plan: motion applies to a predicted accuracy; leave it out")
    from airtruth.design.from_files import Request, planned_from

    options = PlanOptions(limits or Limits(), records, seed)
    source = base_campaign(None if campaign is None else campaign_of(campaign), trace is not None, aircraft)
    stated = Request(split, sizes or {}, derivatives, None if trace is None else as_path("trace", trace))
    to = None if out is None else as_path("out", out)
    return planned_from(source, stated, aircraft, options, to, force=force)


def base_campaign(
    campaign: Path | Campaign | None, traced: bool, aircraft: str | None
) -> Path | Campaign | None:
    """The campaign whose manoeuvres are replaced; where none is given, the default one of a shipped aircraft.

    Parameters
    ----------
    campaign : campaign file or campaign; None for none.
    traced : whether a trace states the flight condition.
    aircraft : shipped name; None for none.
    """
    import tomllib

    from airtruth.simulation.campaign.file import Campaign
    from airtruth.starting import CONDITIONS, campaign_text

    if campaign is not None or traced or aircraft not in CONDITIONS:
        return campaign
    return Campaign.model_validate(tomllib.loads(campaign_text("next", aircraft)))


__all__ = ["base_campaign", "plan"]
