"""Forces of the declared JSBSim model beyond the sum of its lateral tables, along each record.

The tables of `airtruth.tracing.model.plant` add up over the signals. The products of two signals that they lack, such as
a rudder whose side force falls with the sideslip, are evaluated in JSBSim at the measured motion:

    dCY = (Y - Y_tables)/(q_bar S),    dCl = (L - L_tables)/(q_bar S b),    dCn = (N - N_tables)/(q_bar S b).

A product changes little with the noise of the sensors, and is known before anything is fitted. The filter adds it to its
coefficients. For the GTM it is below 1 % of the range of a coefficient.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft.probe import Constants
from airtruth.physics.linear_model import places
from airtruth.physics.motion import LATERAL
from airtruth.physics.motion_parts import reference_length_m
from airtruth.simulation.disposable import isolated_flight
from airtruth.simulation.probe_lateral import FRAMES, lateral_forces
from airtruth.tracing.model.plant import FLOW, Plant, looked_up
from airtruth.tracing.model.records import Signals

Array = NDArray[np.float64]


def along_record(s: Signals, constants: Constants) -> Array:
    """(signals, samples) of the motion along a run [rad, -]."""
    outputs = [LATERAL.output_channels.index(x.channel) for x in LATERAL.states]
    rows = []
    for signal, (is_state, number) in zip(LATERAL.signals, places(LATERAL), strict=True):
        own = s.y[:, outputs[number]] if is_state else s.sampled_controls_rad[number]
        length = reference_length_m(constants, signal.length)
        rows.append(own if signal.length is None else own * (length / (2.0 * s.airspeed_m_s[:: s.sub])))
    return np.stack(rows)


def lateral_remainders(
    signals: Sequence[Signals], plants: Sequence[Plant]
) -> list[NDArray[np.float64] | None]:
    """(3, points) increments of CY, Cl and Cn on the filter's grid of each record; None for one of the linear model.

    Parameters
    ----------
    signals : records, the errors of their input sensors undone; plants : tables of the declared aircraft for each.
    """
    return [_beyond_tables(s, plant) for s, plant in zip(signals, plants, strict=True)]


def _beyond_tables(s: Signals, plant: Plant) -> Array | None:
    at, c = plant.trim, plant.aircraft.constants
    if at is None:
        return None
    alpha = s.alpha_rad[:: s.sub]
    along = along_record(s, c).T
    points, _ = plant.stacked
    inside = np.clip(along, points[:, 0], points[:, -1])
    lengths = [None if x.length is None else reference_length_m(c, x.length) for x in LATERAL.signals]
    states = inside * np.array([1.0 if x is None else 2.0 * at.airspeed_m_s / x for x in lengths])
    flown = isolated_flight(
        FRAMES * len(states),
        f"the lateral forces of {plant.aircraft.name}",
        lateral_forces,
        plant.aircraft,
        at,
        alpha,
        states,
    )
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    known = dict(zip((x.name for x in LATERAL.signals), inside.T, strict=True))
    tables = looked_up(plant, known | {FLOW: alpha}, np.full(len(alpha), pressure))
    scale = np.array([reference_length_m(c, x.length) for x in LATERAL.coefficients])
    found = (flown - tables) / (pressure * c.wing_area_m2 * scale)
    grid = np.arange((len(alpha) - 1) * s.sub + 1) / s.sub
    return np.stack([np.interp(grid, np.arange(len(alpha)), row) for row in found.T])


__all__ = ["along_record", "lateral_remainders"]
