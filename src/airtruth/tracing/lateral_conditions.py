"""The declared aircraft of the lateral-directional motion at the flight condition of records."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.errors import TrimError
from airtruth.physics.motion import LATERAL
from airtruth.simulation.disposable import isolated
from airtruth.simulation.trim import Trim, trim
from airtruth.tracing.model.lateral_plant import (
    LateralPlant,
    Reach,
    declared_lateral,
    linear_lateral,
    probed_lateral,
)
from airtruth.tracing.model.lateral_remainder import along_record
from airtruth.tracing.model.records import Signals, head_samples

Array = NDArray[np.float64]

_MOST_BETA_RAD: Final = 0.35
"""Largest sideslip of the tables [rad] (judgement: 20 deg; a reconstructed sideslip may drift beyond any that is flown)."""


def lateral_plants(
    everyone: Sequence[Signals], members: Sequence[Signals], aircraft: Aircraft, model: str, at: Trim | None
) -> list[LateralPlant]:
    """The plant of each run of one flight condition.

    Parameters
    ----------
    everyone : runs of the condition; members : those that determine it.
    model : "aircraft" or "linear"; at : trim in six axes of the JSBSim aircraft, None without one.
    """
    if model == "linear" or at is None:
        derivatives = declared_lateral(aircraft, at)
        return [_linear(s, aircraft, derivatives) for s in everyone]
    plant = probed_lateral(aircraft, at, _reach(members, aircraft))
    wider = (
        plant if len(members) == len(everyone) else probed_lateral(aircraft, at, _reach(everyone, aircraft))
    )
    return [plant if any(s is m for m in members) else wider for s in everyone]


def flies_in_six_axes(aircraft: Aircraft) -> bool:
    """Whether the aircraft has a JSBSim model with aileron and rudder."""
    model = aircraft.file.jsbsim
    return model is not None and model.aileron is not None and model.rudder is not None


def at_throttle(aircraft: Aircraft, at: Trim, throttle: float) -> Trim:
    """A trim in six axes at another throttle; the flight path takes its place where such a trim exists."""
    with contextlib.suppress(TrimError):
        return isolated(
            f"the trim of {aircraft.name} in six axes",
            trim,
            aircraft,
            at.condition,
            near=at,
            throttle=throttle,
        )
    return replace(at, controls=replace(at.controls, throttle=throttle))


def with_steady_flight(s: Signals, at: Trim | None) -> Signals:
    """A run whose known inputs that the log lacks are those of a trim."""
    if at is None or not s.assumed:
        return s
    steady = {
        "alpha_rad": at.alpha_rad,
        "theta_rad": at.alpha_rad + at.condition.gamma_rad,
        "q_rad_s": 0.0,
    }
    absent = [name for name in s.assumed if name in steady]
    changed = {name: np.full_like(getattr(s, name), steady[name]) for name in absent}
    return replace(s, **changed)


def _reach(runs: Sequence[Signals], aircraft: Aircraft) -> Reach:
    every = [along_record(s, aircraft.constants.span_m) for s in runs]
    low = np.min([x.min(axis=1) for x in every], axis=0)
    high = np.max([x.max(axis=1) for x in every], axis=0)
    ends = np.stack([low, high], axis=1)
    ends[0] = np.clip(ends[0], -_MOST_BETA_RAD, _MOST_BETA_RAD)
    alpha = [s.alpha_rad for s in runs]
    return Reach((min(float(x.min()) for x in alpha), max(float(x.max()) for x in alpha)), ends)


def _linear(s: Signals, aircraft: Aircraft, derivatives: Array) -> LateralPlant:
    """The linear model about the start of a run."""
    head = head_samples(s.dt_s)
    start = along_record(s, aircraft.constants.span_m)[:, :head].mean(axis=1)
    start[[x.length is not None for x in LATERAL.signals]] = 0.0
    phi = float(s.y[:head, LATERAL.output_channels.index("phi_rad")].mean())
    pressure = 0.5 * float(s.density_kg_m3.mean()) * float(np.mean(s.airspeed_m_s**2))
    return linear_lateral(
        aircraft, derivatives, pressure, start, phi, float(s.theta_rad[: head * s.sub].mean())
    )


__all__ = ["at_throttle", "flies_in_six_axes", "lateral_plants", "with_steady_flight"]
