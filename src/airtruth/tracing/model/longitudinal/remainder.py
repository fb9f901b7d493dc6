"""Forces of the declared JSBSim model beyond the tables of its states at rest, along each record.

The declared aircraft is flown in JSBSim through the surface and at the airspeed of the record. At each time the forces
that it has are compared with those of the tables at its own angle of attack, surface and pitch rate:

    dCL = (Z_tables - Z)/(q_bar S),    dCm = (I_yy q' - M_tables)/(q_bar S c).

The differences hold everything that a state at rest does not show: servos and lags behind the surface, terms in
alpha', engines that follow, asymmetry, flexibility of the tables between their points. They are known before anything is
fitted, and the filter adds them to its coefficients. The dynamics that aircraft.toml declares are the filter's own: their
increments are left out.

This flight has level wings. In a record whose lateral motion counts, the forces that sideslip, roll, yaw, ailerons and rudder
add are evaluated in JSBSim at their measured values: the ailerons of the GTM at 3.5 deg pitch it by 0.25 rad/s2.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft.dynamics import declared_dynamics
from airtruth.physics.motion import LATERAL
from airtruth.physics.readings import state_of
from airtruth.simulation.disposable import isolated_flight
from airtruth.simulation.probe_lateral import FRAMES, pitch_forces
from airtruth.simulation.replay import each_flown_through
from airtruth.simulation.tracks import Track, substeps
from airtruth.simulation.trim import Trim
from airtruth.tracing.increment_response import increments
from airtruth.tracing.model.plant import LAYOUTS, Plant, looked_up
from airtruth.tracing.model.probed import flies, probed, trim_of
from airtruth.tracing.model.records import FINE, Signals
from airtruth.tracing.model.surface import through

Array = NDArray[np.float64]

_TOGETHER: Final = 25
"""Records that one process flies [-] (judgement: a minute at 50 Hz takes 2 MB, and its libraries take 50)."""


def remainders(signals: Sequence[Signals], plants: Sequence[Plant]) -> list[Array | None]:
    """Return (2, points) increments of CL and Cm on the filter's grid of each record.

    None stands for a record of the linear model, and for one along which the declared aircraft leaves the range in which
    the simulation has a meaning.

    Parameters
    ----------
    signals : records, the errors of their input sensors undone.
    plants : tables of the declared aircraft about the trim of each record's condition.
    """
    found: list[Array | None] = [None] * len(signals)
    flights = [(i, s, p, p.trim) for i, (s, p) in enumerate(zip(signals, plants, strict=True)) if p.trim]
    for first in range(0, len(flights), _TOGETHER):
        part = flights[first : first + _TOGETHER]
        aircraft = part[0][2].aircraft
        tracks = [(at, track_of(s)) for _, s, _, at in part]
        flown = isolated_flight(
            sum(track.airspeed_m_s.size for _, track in tracks),
            f"the flight of {aircraft.name}",
            each_flown_through,
            aircraft,
            tracks,
        )
        for (i, s, plant, at), own in zip(part, flown, strict=True):
            found[i] = None if own is None else _beyond_tables(s, plant, at, own)
    return [
        more if added is None else added + (0.0 if more is None else more)
        for more, added in zip(found, _beside_lateral(signals, plants), strict=True)
    ]


def _beside_lateral(signals: Sequence[Signals], plants: Sequence[Plant]) -> Iterator[Array | None]:
    """(2, points) increments of CL and Cm that the lateral motion adds to each record; None where it does not count."""
    trims: dict[int, Trim] = {}
    for s, plant in zip(signals, plants, strict=True):
        at, c = plant.trim, plant.aircraft.constants
        if at is None or not s.coupling.size or not flies(plant.aircraft, LATERAL):
            yield None
            continue
        if id(at) not in trims:
            where = at.airspeed_m_s, at.density_kg_m3, at.condition.altitude_m, at.condition.gamma_rad
            trims[id(at)] = trim_of(plant.aircraft, *where, LATERAL)
        level = trims[id(at)]
        states, samples = s.coupling[2:, :: s.sub].T, s.y.shape[0]
        added = isolated_flight(
            2 * FRAMES * samples,
            f"the forces of {plant.aircraft.name} in roll and yaw",
            pitch_forces,
            plant.aircraft,
            level,
            s.y[:, 0],
            states,
        )
        force = 0.5 * level.density_kg_m3 * level.airspeed_m_s**2 * c.wing_area_m2
        grid = np.arange((samples - 1) * s.sub + 1) / s.sub
        rows = (-added[:, 0] / force, added[:, 1] / (force * c.chord_m))
        yield np.stack([np.interp(grid, np.arange(samples), row) for row in rows])


def _beyond_tables(signals: Signals, plant: Plant, at: Trim, flown: Mapping[str, Array]) -> Array:
    """The increments of one flown record; see `remainders`."""
    dt_s = signals.dt_s / substeps(signals.dt_s)
    c = plant.aircraft.constants
    speed = flown["airspeed_m_s"]
    pressure = 0.5 * flown["density_kg_m3"] * speed**2
    half = 0.5 * c.chord_m / speed
    change = declared_dynamics(plant.aircraft.file.dynamics)
    alpha, q, az, surface = (flown[name] for name in plant.motion.channels)
    (names,) = LAYOUTS[plant.motion.name]
    motion = dict(zip(names, (alpha, through(change.surface, surface, dt_s), q * half), strict=True))
    _, fz, moment = looked_up(_reaching(plant, at, motion, q), motion, pressure).T
    force = pressure * c.wing_area_m2
    found = np.stack(
        [
            (fz - az * at.mass_kg) / force,
            (c.inertia_yy_kg_m2 * flown["q_dot_rad_s2"] - moment) / (force * c.chord_m),
        ]
    )
    if change.aero:
        turn = np.gradient(alpha, dt_s) * half
        known = motion | {plant.motion.flow_rate: turn, "qbar": pressure}
        signals_ = {name: x[None] for name, x in known.items()}
        signals_ |= {s.name: state_of(s, signals_[s.signal], dt_s) for s in change.states}
        found -= increments(change.aero, signals_)[:, 0]
    grid = np.arange((signals.y.shape[0] - 1) * signals.sub + 1) * (signals.dt_s / signals.sub)
    time = np.arange(found.shape[1]) * dt_s
    return np.stack([np.interp(grid, time, row) for row in found])


def _reaching(plant: Plant, at: Trim, motion: Mapping[str, Array], q_rad_s: Array) -> Plant:
    """The plant, with wider tables where the declared model flies beyond those that the record needs.

    At the wrong airspeed, mass or CG it may reach angles that were never flown. Extrapolated tables would turn into a remainder.
    """
    (table,) = plant.tables
    to_trim = 0.5 * plant.aircraft.constants.chord_m / at.airspeed_m_s
    reached = [*(motion[name] for name in table.signals[:-1]), q_rad_s * to_trim]
    if all(axis[0] <= x.min() and x.max() <= axis[-1] for axis, x in zip(table.axes, reached, strict=True)):
        return plant
    alpha, elevator = ((float(x.min()), float(x.max())) for x in reached[:-1])
    return probed(plant.aircraft, at, alpha, elevator, float(np.abs(q_rad_s).max()))


def track_of(signals: Signals) -> Track:
    """Inputs of a record on the simulation's grid."""
    steps = substeps(signals.dt_s)
    grid = np.arange((signals.y.shape[0] - 1) * steps + 1) / steps

    def on_grid(fine: Array, cells: int) -> Array:
        return np.interp(grid, np.arange(len(fine)) / cells, fine)

    return Track(
        dt_s=signals.dt_s,
        substeps=steps,
        outputs={},
        weight={},
        controls_rad={
            control.name: on_grid(x, signals.sub * FINE)
            for control, x in zip(signals.motion.controls, signals.controls_rad, strict=True)
        },
        airspeed_m_s=on_grid(signals.airspeed_m_s, signals.sub),
    )


__all__ = ["remainders", "track_of"]
