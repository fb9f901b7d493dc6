"""The linear model of one estimate in a file of estimates, or of an aircraft at a flight condition."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.exporting.model import FlightPoint, LinearModel
from airtruth.identification.record_constants import LateralValues, RecordConstants, values_of
from airtruth.logs.names import ESTIMATES
from airtruth.logs.parquet import SUFFIX, is_parquet
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.motion import LATERAL, LONGITUDINAL, motion_of

if TYPE_CHECKING:
    import pandas as pd

    from airtruth.aircraft import Aircraft
    from airtruth.simulation.trim import Trim

Array = NDArray[np.float64]

_AIR: Final = ("airspeed_m_s", "density_kg_m3")
"""Columns of a file of estimates with airspeed and density."""
_CONDITION: Final[Mapping[str, tuple[str, ...]]] = {
    LONGITUDINAL.name: _AIR,
    LATERAL.name: (*_AIR, LONGITUDINAL.vane, "theta_rad"),
}
"""Motion -> columns of a file of estimates with the flight condition."""


def estimates_file(source: Path) -> Path | None:
    """The file of estimates that a path means: itself, or the first motion's in a folder; None for an aircraft."""
    if source.is_file() and (source.suffix == SUFFIX or is_parquet(source)):
        return source
    return next((source / name for name in ESTIMATES.values() if (source / name).is_file()), None)


def linear_model(
    source: Path,
    method: str | None = None,
    run_id: str | None = None,
    airspeed_m_s: float | None = None,
    altitude_m: float | None = None,
) -> LinearModel:
    """Return the motion of an estimate, or the short period of an aircraft, as a linear model.

    Several runs give their mean. Its covariance is that of one run over their number, widened for each derivative to the
    scatter of the runs where that is larger.

    Parameters
    ----------
    source : file of estimates of a motion, or a folder, whose longitudinal ones come first; or an
        aircraft: folder, aircraft.toml or shipped name.
    method : method of the estimates; None if they hold one.
    run_id : run of the estimates; None for the mean over the converged runs.
    airspeed_m_s, altitude_m : true airspeed [m/s] and altitude of an aircraft [m]; estimates state their own condition.

    Raises
    ------
    ConfigurationError
        If the choice is ambiguous or does not exist, or an option does not fit the source.
    StoreError, LogError, AircraftError, TrimError
        If a file cannot be read, or the aircraft cannot fly there.
    """
    file = estimates_file(source)
    if file is not None:
        if airspeed_m_s is not None or altitude_m is not None:
            raise ConfigurationError(
                f"{file}: estimates state their flight condition; leave airspeed and altitude out"
            )
        return _of_estimates(file, method, run_id)
    from airtruth.aircraft import load

    if method is not None or run_id is not None:
        raise ConfigurationError(f"{source}: is an aircraft; a method and a run choose among estimates")
    aircraft = load(source)
    if airspeed_m_s is None or altitude_m is None:
        raise ConfigurationError(
            f"{source}: is an aircraft, which needs a flight condition: --airspeed-m-s and --altitude-m"
        )
    if not (0.0 < airspeed_m_s < np.inf):
        raise ConfigurationError(f"airspeed {airspeed_m_s:g} m/s: has to be above 0")
    return _of_aircraft(aircraft, airspeed_m_s, altitude_m)


def _of_estimates(file: Path, method: str | None, run_id: str | None) -> LinearModel:
    from airtruth.identification.covariance_columns import covariance_of
    from airtruth.identification.stored import read_stored

    frame, records = read_stored(file)
    motion = motion_of(frame.columns)
    condition = list(_CONDITION[motion.name])
    chosen = _method(file, frame, method)
    own = _rows(file, frame[frame["method"] == chosen], chosen, run_id)
    if (
        chosen not in records
        or not set(condition) <= set(own.columns)
        or own[condition].isna().any(axis=None)
    ):
        raise ConfigurationError(
            f"{file}: the rows of {chosen} lack the flight condition ({', '.join(condition)}), as files of "
            "earlier versions do; identify the logs again"
        )
    names = list(motion.parameters)
    covariance = covariance_of(own, names)
    notes: tuple[str, ...] = ("Outputs are at the centre of gravity, without errors of the instruments.",)
    if not np.isfinite(covariance).all():
        notes += (f"{chosen} states no covariance for these runs, so that the uncertainty is not known.",)
    theta = own[names].to_numpy(dtype=np.float64)
    constants, runs = records[chosen]["constants"], own["run_id"].tolist()
    at = {name: float(own[name].mean()) for name in condition}
    trim = {name: at.pop(name) for name in condition if name not in _AIR}
    kind = LateralValues if motion is LATERAL else RecordConstants
    known = kind(**{f.name: float(constants[f.name]) for f in fields(kind)})
    point = FlightPoint(**at, constants=known, trim=trim)
    of = f"run {runs[0]}" if len(runs) == 1 else f"mean of {len(runs)} converged runs"
    return LinearModel(
        motion=motion,
        point=point,
        derivatives=theta.mean(axis=0),
        derivative_covariance=_of_mean(theta, covariance),
        source=f"{chosen}, {of}, {records[chosen]['aircraft']}",
        notes=(*notes, *records[chosen]["notes"]),
    )


def _method(file: Path, frame: pd.DataFrame, method: str | None) -> str:
    methods = list(dict.fromkeys(frame["method"]))
    if not methods:
        raise ConfigurationError(f"{file}: holds no estimates; identify a log again")
    if method is None and len(methods) > 1:
        raise ConfigurationError(
            f"{file}: holds several methods; choose one by --method: {', '.join(methods)}"
        )
    if method is not None and method not in methods:
        raise ConfigurationError(f"{file}: method {method!r}: {choices(method, methods)}")
    return method or str(methods[0])


def _rows(file: Path, own: pd.DataFrame, method: str, run_id: str | None) -> pd.DataFrame:
    """The row of a run, or those of all converged runs."""
    if run_id is not None:
        runs = own["run_id"].tolist()
        if run_id not in runs:
            raise ConfigurationError(f"{file}: run {run_id!r}: {choices(run_id, runs)}")
        own = own[own["run_id"] == run_id]
    good = own[own["converged"]] if "converged" in own else own
    if good.empty:
        which = f"run {run_id}" if run_id is not None else "no run"
        ended = "did not converge" if run_id is not None else "converged"
        raise ConfigurationError(f"{file}: {which} of {method} {ended}; choose another method or run")
    return good


def _of_mean(theta: Array, covariance: Array) -> Array:
    """Covariance of the mean of independent runs.

    Parameters
    ----------
    theta : (runs, n) estimates; covariance : (runs, n, n) as stated.
    """
    stated = covariance.mean(axis=0)
    if len(theta) == 1:
        return np.asarray(stated)
    std = np.sqrt(np.maximum(np.diag(stated), np.finfo(np.float64).tiny))
    wider = np.maximum(theta.std(axis=0, ddof=1) / std, 1.0)
    return np.asarray(stated * np.outer(wider, wider) / len(theta))


def _of_aircraft(aircraft: Aircraft, airspeed_m_s: float, altitude_m: float) -> LinearModel:
    from airtruth.tracing.model.declared import declared_covariance
    from airtruth.tracing.model.plant import declared_derivatives
    from airtruth.tracing.model.probed import trim_of

    density = float(density_kg_m3(altitude_m))
    at: Trim | None = None
    if aircraft.file.jsbsim is not None:
        at = trim_of(aircraft, airspeed_m_s, density, altitude_m, 0.0)
    derivatives = declared_derivatives(aircraft, at)
    constants = values_of(aircraft.constants)
    trim = {}
    if at is not None:
        constants = replace(constants, mass_kg=at.mass_kg)
        signals = zip(LONGITUDINAL.signals, at.origin(LONGITUDINAL).tolist(), strict=True)
        trim = {signal.channel: value for signal, value in signals if signal.length is None}
    point = FlightPoint(airspeed_m_s, density, constants, {**trim, "altitude_m": altitude_m})
    source = (
        "derivatives of aircraft.toml"
        if at is None
        else "central differences of the JSBSim model at its trim"
    )
    return LinearModel(
        motion=LONGITUDINAL,
        point=point,
        derivatives=derivatives,
        derivative_covariance=declared_covariance(aircraft, derivatives),
        source=f"{aircraft.name}, {source}",
        notes=(
            "Outputs are at the centre of gravity, without errors of the instruments.",
            "The covariance is the declared uncertainty, that of mass, inertia and CG included.",
        ),
    )


__all__ = ["estimates_file", "linear_model"]
