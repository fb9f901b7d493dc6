"""Flight conditions of the records of a trace: the declared aircraft and the gusts of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import BANK
from airtruth.errors import LogError, TrimError
from airtruth.physics.gust_figures import gust_scales, side_gust
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.simulation.trim import Trim
from airtruth.tracing.model.lateral.remainder import along_record, lateral_remainders
from airtruth.tracing.model.longitudinal.remainder import remainders
from airtruth.tracing.model.plant import FLOW, Plant, declared_derivatives, linear
from airtruth.tracing.model.probed import engines, flies, probed, probed_lateral, trim_of, with_throttle
from airtruth.tracing.model.records import FINE, Signals, TraceRecord, head_samples
from airtruth.tracing.model.settings import declared_derivatives_of
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

_SAME_SPEED: Final = 0.03
"""Relative difference in airspeed within which records share a plant [-] (judgement: 6 % in dynamic pressure, which
the filter follows; more plants cost more probes of JSBSim)."""
_SAME_ALTITUDE_M: Final = 200.0
"""Difference in altitude within which records share a plant [m] (judgement: 2 % in density)."""
_CLIMB_RAD: Final = 1.0 * DEG
"""Flight-path angle below which a record starts in level flight [rad] (judgement: the noise of theta - alpha)."""
_CLIMB_SAMPLES: Final = 10
"""Number of samples at the start of a record whose mean is its flight-path angle [-] (judgement)."""
_TRIM_SPEEDS: Final = 25
"""Number of airspeeds of a record at which a trim is sought where there is none at its mean [-] (judgement: steps of 1 m/s
in a record that loses half of 43 m/s)."""
_OTHER_TRIM: Final = 2.0 * _SAME_SPEED
"""Relative difference between trim and mean airspeed that is reported [-]: records of one condition differ by less."""
_FAR: Final = 2.0
"""Ratio of dynamic pressures, up or down, from which a record is reported to leave its trim [-] (judgement: the engines are
probed within 6 % and extrapolated as a line)."""
_FIGURES: Final = "mil-f-8785c"
"""Source of the gusts' scale lengths."""
_GUST_ALTITUDE_M: Final = (30.0, 20000.0)
"""Altitudes between which the gust scales are evaluated [m] (judgement: within the range of MIL-F-8785C)."""
_MOST_BETA_RAD: Final = 0.35
"""Largest sideslip of the tables [rad] (judgement: 20 deg; a reconstructed sideslip may drift beyond any that is flown)."""


def records_of(
    signals: Sequence[Signals], aircraft: Aircraft, model: str, held: Sequence[str]
) -> list[TraceRecord]:
    """Records with the declared aircraft and the gusts of their flight conditions.

    Fitted records of one condition share a plant. Held-out records have no influence on it; they have tables of their
    own about the same trim, over the range that they reach.

    Parameters
    ----------
    signals : runs; held : names of those that are held out; model : "aircraft" or "linear".

    Raises
    ------
    LogError
        If the aircraft has a trim at no airspeed that the records of a condition reach.
    """
    records: dict[int, TraceRecord] = {}
    for group in _conditions(signals, held):
        everyone = [signals[i] for i in group]
        members = [s for s in everyone if s.run_id not in held] or everyone
        motion = members[0].motion
        length = gust_length_m(float(np.mean([s.altitude_m for s in members])), motion)
        at = _trim(aircraft, members) if flies(aircraft, motion) else None
        full = [_with_steady_flight(s, at) for s in everyone]
        own = [s for s, given in zip(full, everyone, strict=True) if any(given is m for m in members)]
        plants = _plants(full, own, aircraft, model, at)
        more = (remainders if motion is LONGITUDINAL else lateral_remainders)(full, plants)
        made = (TraceRecord(s, plant, length, x) for s, plant, x in zip(full, plants, more, strict=True))
        records |= dict(zip(group, made, strict=True))
    return [records[i] for i in range(len(signals))]


def with_mean_derivatives(records: Sequence[TraceRecord], held: Sequence[str]) -> list[TraceRecord]:
    """Records of several flight conditions, each plant with the declared derivatives averaged over those that are fitted.

    Parameters
    ----------
    held : names of the records that are held out.
    """
    mean = declared_derivatives_of([r for r in records if r.signals.run_id not in held])
    plants = {id(r.plant): r.plant for r in records}
    if all(np.array_equal(plant.derivatives, mean) for plant in plants.values()):
        return list(records)
    plants = {number: replace(plant, mean_derivatives=mean) for number, plant in plants.items()}
    return [replace(r, plant=plants[id(r.plant)]) for r in records]


def _with_steady_flight(s: Signals, at: Trim | None) -> Signals:
    """A run whose known inputs that the log lacks are those of a trim."""
    if at is None or not s.assumed:
        return s
    steady = {
        LONGITUDINAL.vane: at.alpha_rad,
        "theta_rad": at.alpha_rad + at.condition.gamma_rad,
        LONGITUDINAL.gyros[0]: 0.0,
    }
    absent = [name for name in s.assumed if name in steady]
    changed = {name: np.full_like(getattr(s, name), steady[name]) for name in absent}
    return replace(s, **changed)


def _speed_and_density(members: Sequence[Signals]) -> tuple[float, float]:
    """Mean airspeed [m/s] and density [kg/m3] of the runs that determine a condition."""
    speed = float(np.mean([s.airspeed_m_s.mean() for s in members]))
    return speed, float(np.mean([s.density_kg_m3.mean() for s in members]))


def _conditions(signals: Sequence[Signals], held: Sequence[str]) -> list[list[int]]:
    """Indices of the runs of each flight condition, fitted runs first."""
    groups: list[list[int]] = []
    for i, s in sorted(enumerate(signals), key=lambda item: item[1].run_id in held):
        for group in groups:
            first = signals[group[0]]
            near = abs(s.airspeed_m_s.mean() / first.airspeed_m_s.mean() - 1.0) < _SAME_SPEED
            if near and abs(s.altitude_m - first.altitude_m) < _SAME_ALTITUDE_M:
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def _plants(
    everyone: Sequence[Signals], members: Sequence[Signals], aircraft: Aircraft, model: str, at: Trim | None
) -> list[Plant]:
    """The plant of each run of one flight condition; ``members`` are the runs that determine the condition."""
    motion = members[0].motion
    if model == "linear" or at is None:
        derivatives = declared_derivatives(aircraft, at, motion)
        if motion is LATERAL:
            return [_linear_lateral(s, aircraft, derivatives) for s in everyone]
        speed, density = _speed_and_density(members)
        power = None if at is None else engines(aircraft, at)
        weight = np.array([0.0, -aircraft.constants.mass_kg * G0, 0.0])
        pressure = 0.5 * density * speed**2
        starts = [np.array([alpha, 0.0, control]) for alpha, control in map(_start_of, everyone)]
        return [linear(aircraft, motion, derivatives, pressure, start, weight, power) for start in starts]
    tabulated = _probed if motion is LONGITUDINAL else _probed_lateral
    plant = tabulated(aircraft, at, members)
    wider = plant if len(members) == len(everyone) else tabulated(aircraft, at, everyone)
    return [plant if any(s is m for m in members) else wider for s in everyone]


def _start_of(s: Signals) -> tuple[float, float]:
    """Mean angle of attack and elevator [rad] over the start of a run."""
    head = head_samples(s.dt_s)
    return float(s.y[:head, 0].mean()), float(s.controls_rad[0, : head * s.sub * FINE].mean())


def _probed(aircraft: Aircraft, at: Trim, runs: Sequence[Signals]) -> Plant:
    """Tables over the angles and pitch rates that the runs reach."""
    rate = max(float(np.abs(s.y[:, 1]).max()) for s in runs)
    return probed(
        aircraft, at, _reach([s.y[:, 0] for s in runs]), _reach([s.controls_rad for s in runs]), rate
    )


def _linear_lateral(s: Signals, aircraft: Aircraft, derivatives: Array) -> Plant:
    """The linear model about the start of a run, whose air holds the weight's side component there without a moment."""
    head, c = head_samples(s.dt_s), aircraft.constants
    start = along_record(s, c)[:, :head].mean(axis=1)
    start[[x.length is not None for x in LATERAL.signals]] = 0.0
    phi = float(s.y[:head, LATERAL.output_channels.index(BANK)].mean())
    side = c.mass_kg * G0 * np.cos(float(s.theta_rad[: head * s.sub].mean())) * np.sin(phi)
    pressure = 0.5 * float(s.density_kg_m3.mean()) * float(np.mean(s.airspeed_m_s**2))
    return linear(aircraft, LATERAL, derivatives, pressure, start, np.array([-side, 0.0, 0.0]))


def _probed_lateral(aircraft: Aircraft, at: Trim, runs: Sequence[Signals]) -> Plant:
    """Tables over the angles and rates that the runs reach."""
    every = np.concatenate([along_record(s, aircraft.constants) for s in runs], axis=1)
    reach = {x.name: _reach([row]) for x, row in zip(LATERAL.signals, every, strict=True)}
    low, high = np.clip(reach[LATERAL.flow], -_MOST_BETA_RAD, _MOST_BETA_RAD).tolist()
    return probed_lateral(
        aircraft, at, {**reach, LATERAL.flow: (low, high), FLOW: _reach([s.alpha_rad for s in runs])}
    )


def _reach(series: Sequence[Array]) -> tuple[float, float]:
    """Smallest and largest value."""
    return min(float(x.min()) for x in series), max(float(x.max()) for x in series)


def _trim(aircraft: Aircraft, members: Sequence[Signals]) -> Trim:
    s, (speed, density) = members[0], _speed_and_density(members)
    climb = float(
        np.mean([m.theta_rad[: _CLIMB_SAMPLES * m.sub].mean() - _first_alpha_rad(m) for m in members])
    )
    gamma = climb if abs(climb) > _CLIMB_RAD else 0.0
    level = (speed, 0.0)
    problems: dict[tuple[float, float], TrimError] = {}
    for tried in dict.fromkeys([(speed, gamma), level, *((v, 0.0) for v in _reached_speeds(members, speed))]):
        try:
            at = trim_of(aircraft, tried[0], density, s.altitude_m, tried[1], s.motion)
            levers = [m.throttle for m in members if m.throttle is not None]
            # the logged throttle counts, not that of the declared trim
            return with_throttle(aircraft, at, float(np.mean(levers))) if levers else at
        except TrimError as error:
            problems[tried] = error
    raise LogError(
        f"the declared aircraft {aircraft.name} cannot fly steadily at the {speed:.3g} m/s and {s.altitude_m:.0f} m of "
        f"run {s.run_id}, nor at another airspeed that it reaches ({problems[level]}): is it another aircraft, or another "
        "unit of airspeed?"
    )


def _first_alpha_rad(s: Signals) -> float:
    """Mean angle of attack over the start of a run [rad]."""
    if s.motion is LONGITUDINAL:
        return float(s.y[:_CLIMB_SAMPLES, 0].mean())
    return float(s.alpha_rad[: _CLIMB_SAMPLES * s.sub].mean())


def _reached_speeds(members: Sequence[Signals], speed: float) -> list[float]:
    """Airspeeds that the runs reach [m/s], those nearest to ``speed`` first."""
    low = min(float(m.airspeed_m_s.min()) for m in members)
    high = max(float(m.airspeed_m_s.max()) for m in members)
    return sorted(np.linspace(low, high, _TRIM_SPEEDS).tolist(), key=lambda v: abs(v - speed))


def condition_notes(records: Sequence[TraceRecord]) -> list[str]:
    """Notes on records that leave the flight condition about which the declared aircraft is probed, without a final period."""
    return [note for record in records for note in (*_away(record), *_departs(record))]


def _away(record: TraceRecord) -> list[str]:
    """A record that has no trim at its mean airspeed, or that leaves the dynamic pressure of its trim."""
    s, at = record.signals, record.plant.trim
    if at is None:
        return []
    mean = float(s.airspeed_m_s.mean())
    if abs(at.airspeed_m_s / mean - 1.0) > _OTHER_TRIM:
        return [
            f"{s.run_id} has a mean airspeed of {mean:.3g} m/s, where the declared aircraft cannot fly steadily: its forces are "
            f"those about a trim at {at.airspeed_m_s:.3g} m/s, evaluated at the airspeeds of the record"
        ]
    ratio = s.density_kg_m3 * s.airspeed_m_s**2 / (at.density_kg_m3 * at.airspeed_m_s**2)
    farthest = int(np.argmax(np.abs(np.log(ratio))))
    if abs(np.log(ratio[farthest])) < np.log(_FAR):
        return []
    return [
        f"{s.run_id} reaches {float(s.airspeed_m_s[farthest]):.3g} m/s and {ratio[farthest]:.2g} of the dynamic pressure of its "
        f"trim at {at.airspeed_m_s:.3g} m/s, about which the declared aircraft is probed: what engines and Mach number add is "
        "not probed there; trace without this record as well, and compare the answers"
    ]


def _departs(record: TraceRecord) -> list[str]:
    """A record along which the declared aircraft leaves the range of the simulation."""
    if record.plant.trim is None or record.remainder is not None:
        return []
    return [
        f"along {record.signals.run_id} the declared aircraft departs in JSBSim, or its model ends the simulation: the servos, "
        "lags and terms in alpha_dot of the model are left out for this record"
    ]


def gust_length_m(altitude_m: float, motion: Motion = LONGITUDINAL) -> float:
    """Scale length of the gust that the filter of a motion estimates [m], in light turbulence at an altitude [m]."""
    lowest, highest = _GUST_ALTITUDE_M
    scales = gust_scales(_FIGURES, "light", min(max(altitude_m, lowest), highest))
    return scales.length_w_m if motion is LONGITUDINAL else side_gust(_FIGURES, scales)[1]


__all__ = ["condition_notes", "gust_length_m", "records_of"]
