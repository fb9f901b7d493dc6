"""From logs and an aircraft to the problem that the search solves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft, Sensor
from airtruth.effects.effect import Effect
from airtruth.errors import ConfigurationError, LogError, TrimError, choices
from airtruth.fly.trim import Trim
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.gust_figures import gust_scales
from airtruth.trace.fit import Hypothesis, Problem
from airtruth.trace.model import Settings, declared_change, settings_of
from airtruth.trace.options import TraceOptions
from airtruth.trace.plant import Plant, declared_derivatives, engines, linear, probed, trim_of
from airtruth.trace.records import FINE, Record, Signals, lead_s, read, undone
from airtruth.units import DEG

Array = NDArray[np.float64]

_SAME_SPEED: Final = 0.03
_SAME_ALTITUDE_M: Final = 200.0
_LEAST_SAMPLES: Final = 40
_LEAST_ELEVATOR_RAD: Final = 0.1 * DEG
_THRUST_STD: Final = 0.05
_THRUST_UNKNOWN_STD: Final = 0.25
_AIR: Final = (
    "the level of the gusts is each record's own, and the measured airspeed carries the horizontal ones"
)


@dataclass(frozen=True)
class Case:
    """What is traced.

    Attributes
    ----------
    fitted, held : problems of the records fitted and held out (None without any).
    hypothesis : the declared aircraft.
    effects : candidates that can be tested; untestable : (key, why not) of the others.
    model : "aircraft" or "linear".
    notes : sentences for the report.
    """

    fitted: Problem
    held: Problem | None
    hypothesis: Hypothesis
    effects: tuple[Effect, ...]
    untestable: tuple[tuple[Effect, str], ...]
    model: str
    notes: tuple[str, ...]


def prepare(
    logs: Sequence[FlightLog], aircraft: Aircraft, effects: Sequence[Effect], options: TraceOptions
) -> Case:
    """Check the records, build the declared plant about each flight condition, and split off what is held out.

    Raises
    ------
    LogError, ConfigurationError, AircraftError
        Saying what is wrong, where, and what to do.
    """
    _one_aircraft(logs, aircraft)
    pots = aircraft.file.sensors.get("elevator_rad")
    noise = pots.noise_std.value if pots else 0.0
    signals = [inputs_undone(s, aircraft) for log in logs for s in read(log, noise)]
    chosen = _hold_out([s.run_id for s in signals], options)
    _check(signals, chosen)
    columns = set.intersection(*(set(log.channels) for log in logs))
    model = options.model if aircraft.file.jsbsim is not None else "linear"
    notes = []
    if model != options.model:
        notes.append("the aircraft has no JSBSim model: the loop's model is the linear short-period model")
    plants = _plants(signals, aircraft, model, chosen)
    records = [Record(s, plant) for s, plant in zip(signals, plants, strict=True)]
    fitted = tuple(r for r in records if r.signals.run_id not in chosen)
    settings = _settings(aircraft, [r.signals for r in fitted], fitted[0].plant.derivatives)
    held = tuple(r for r in records if r.signals.run_id in chosen)
    if len(fitted) == 1:
        notes.append("one record is fitted: its halves stand in for records left out")
        fitted = _halves(fitted[0])
    if not held:
        notes.append("nothing is held out: the verdict is provisional")
    testable, untestable = [], []
    for effect in effects:
        missing = [c for c in effect.channels if c not in columns]
        if missing:
            untestable.append((effect, f"the log lacks {', '.join(missing)}"))
        elif effect.where == "air":
            untestable.append((effect, _AIR))
        else:
            testable.append(effect)
    return Case(
        fitted=Problem(fitted, settings, options.threads),
        held=Problem(held, settings, options.threads) if held else None,
        hypothesis=Hypothesis(declared_change(aircraft), trim_alpha_rad=fitted[0].plant.trim_alpha_rad),
        effects=tuple(testable),
        untestable=tuple(untestable),
        model=model,
        notes=tuple(notes),
    )


def _one_aircraft(logs: Sequence[FlightLog], aircraft: Aircraft) -> None:
    names = sorted({str(log.metadata["aircraft"]) for log in logs if log.metadata.get("aircraft")})
    if len(names) > 1:
        raise LogError(
            f"the records are of several aircraft ({', '.join(names)}): trace the records of one aircraft at a time"
        )
    runs = [run for log in logs for run in log.run_ids]
    twice = sorted({run for run in runs if runs.count(run) > 1})
    if twice:
        raise LogError(f"run_id {twice[0]!r} occurs in several logs: give every record a name of its own")


def inputs_undone(s: Signals, aircraft: Aircraft) -> Signals:
    """A run with elevator and airspeed as they were before what aircraft.toml declares of their sensors."""

    def true(channel: str, x: Array, cells: int) -> Array:
        sensor = aircraft.file.sensors.get(channel, Sensor())
        late = lead_s(sensor) / s.dt_s * cells
        if late > 0.0:
            at = np.arange(len(x))
            x = np.interp(at + late, at, x)
        return undone(x, sensor)

    return replace(
        s,
        elevator_rad=true("elevator_rad", s.elevator_rad, s.sub * FINE),
        airspeed_m_s=true("airspeed_m_s", s.airspeed_m_s, s.sub),
        ground_m_s=true("airspeed_m_s", s.ground_m_s, s.sub),
    )


def _check(signals: Sequence[Signals], held: Sequence[str]) -> None:
    for s in signals:
        if s.y.shape[0] < _LEAST_SAMPLES:
            raise LogError(
                f"run {s.run_id}: {s.y.shape[0]} samples; a record needs at least {_LEAST_SAMPLES} to be traced"
            )
    moved = max(float(np.ptp(s.elevator_rad)) for s in signals if s.run_id not in held)
    if moved < _LEAST_ELEVATOR_RAD:
        which = "record that is not held out" if held else "record"
        raise LogError(
            f"no {which} moves the elevator by more than {moved / DEG:.3g} deg: without an input nothing can be told "
            "apart; fly doublets or 3-2-1-1 of at least 1 deg"
        )


def _hold_out(runs: Sequence[str], options: TraceOptions) -> tuple[str, ...]:
    if options.hold_out is None:
        return tuple(runs[2::3]) if len(runs) > 1 and len(runs) >= 3 else ()
    for run in options.hold_out:
        if run not in runs:
            raise ConfigurationError(f"--hold-out {run!r}: no such run; {choices(run, runs)}")
    if len(set(options.hold_out)) == len(runs):
        raise ConfigurationError("--hold-out names every run: leave at least one to fit")
    return tuple(options.hold_out)


def _plants(signals: Sequence[Signals], aircraft: Aircraft, model: str, held: Sequence[str]) -> list[Plant]:
    """One plant per flight condition (airspeed within 3 %, altitude within 200 m), shared by its fitted records.

    Held-out records have no say in it; they have tables of their own, about the same trim, over what they visited.
    """
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
    found: dict[int, Plant] = {}
    for group in groups:
        everyone = [signals[i] for i in group]
        members = [s for s in everyone if s.run_id not in held] or everyone
        speed = float(np.mean([s.airspeed_m_s.mean() for s in members]))
        density = float(np.mean([s.density_kg_m3.mean() for s in members]))
        if model == "linear":
            at = _trim(aircraft, members, speed, density) if aircraft.file.jsbsim is not None else None
            derivatives = declared_derivatives(aircraft, at)
            power = None if at is None else engines(aircraft, at)
            for i in group:
                s = signals[i]
                head = max(3, int(0.1 / s.dt_s))
                alpha = float(s.y[:head, 0].mean())
                elevator = float(s.elevator_rad[: head * s.sub * FINE].mean())
                found[i] = linear(aircraft, derivatives, speed, density, alpha, elevator, power)
            continue
        at = _trim(aircraft, members, speed, density)
        plant = _probed(aircraft, at, members)
        wider = plant if len(members) == len(everyone) else _probed(aircraft, at, everyone)
        for i in group:
            found[i] = wider if signals[i].run_id in held else plant
    return [found[i] for i in range(len(signals))]


def _probed(aircraft: Aircraft, at: Trim, runs: Sequence[Signals]) -> Plant:
    """Tables over what some runs visited."""
    rate = max(float(np.abs(s.y[:, 1]).max()) for s in runs)
    return probed(
        aircraft, at, _reach([s.y[:, 0] for s in runs]), _reach([s.elevator_rad for s in runs]), rate
    )


def _reach(found: Sequence[Array]) -> tuple[float, float]:
    return min(float(x.min()) for x in found), max(float(x.max()) for x in found)


def _trim(aircraft: Aircraft, members: Sequence[Signals], speed: float, density: float) -> Trim:
    s = members[0]
    climb = float(np.mean([m.theta_rad[: 10 * m.sub].mean() - m.y[:10, 0].mean() for m in members]))
    gamma = climb if abs(climb) > 1.0 * DEG else 0.0
    for tried in (gamma, 0.0):
        try:
            at = trim_of(aircraft, speed, density, s.altitude_m, tried)
            levers = [m.throttle for m in members if m.throttle is not None]
            if levers:  # as it was set, not as the declared aircraft would need it
                at = replace(at, controls=replace(at.controls, throttle=float(np.mean(levers))))
            return at
        except TrimError as error:
            problem = error
    raise LogError(
        f"the declared aircraft {aircraft.name} cannot fly steadily at the {speed:.3g} m/s and {s.altitude_m:.0f} m of "
        f"run {s.run_id} ({problem}): is it another aircraft, or another unit of airspeed?"
    )


def _settings(aircraft: Aircraft, signals: Sequence[Signals], derivatives: Array) -> Settings:
    altitude = float(np.mean([s.altitude_m for s in signals]))
    scales = gust_scales("mil-f-8785c", "light", min(max(altitude, 30.0), 20000.0))
    known = all(s.throttle is not None for s in signals)
    return settings_of(
        aircraft, scales.length_w_m, _THRUST_STD if known else _THRUST_UNKNOWN_STD, derivatives
    )


def _halves(record: Record) -> tuple[Record, Record]:
    """The record cut where half of the elevator's travel is done, so that both parts are excited."""
    s = record.signals
    travel = np.cumsum(np.abs(np.diff(s.elevator_rad[:: s.sub * FINE])))
    half = int(np.searchsorted(travel, 0.5 * travel[-1]))
    middle = min(max(half, _LEAST_SAMPLES // 2), s.y.shape[0] - _LEAST_SAMPLES // 2)
    halves = []
    for name, first, last in (("first half", 0, middle), ("second half", middle, s.y.shape[0])):
        points = slice(first * s.sub, (last - 1) * s.sub + 1)
        fine = slice(first * s.sub * FINE, (last - 1) * s.sub * FINE + 1)
        cut = replace(
            s,
            run_id=f"{s.run_id}, {name}",
            y=np.ascontiguousarray(s.y[first:last]),
            elevator_rad=s.elevator_rad[fine],
            airspeed_m_s=s.airspeed_m_s[points],
            ground_m_s=s.ground_m_s[points],
            density_kg_m3=s.density_kg_m3[points],
            theta_rad=s.theta_rad[points],
        )
        halves.append(Record(cut, record.plant))
    return halves[0], halves[1]
