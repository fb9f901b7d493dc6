"""Records beside the motion that identified derivatives predict.

The linear short period (M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (2) and (3))
is simulated from the measured elevator at the mean airspeed and density of the record. Initial state, trim and the
offset of az are each record's own, and every method has the same of them: they enter the outputs linearly and are
fitted by least squares, the channels weighted by their standard deviations. The lateral motion is that of
`airtruth.identification.lateral.simulated`.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from airtruth.identification.condition import AircraftConstants
from airtruth.identification.declared_sensors import Taken, as_ideal
from airtruth.identification.estimates import JOINT
from airtruth.identification.lateral.simulated import simulate as simulate_lateral
from airtruth.identification.record_constants import (
    LateralValues,
    RecordConstants,
    of_run,
    stated_value,
    values_of,
)
from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.logs.histories import Histories, History
from airtruth.logs.sources import Logs, named_logs
from airtruth.physics.atmosphere import air_density
from airtruth.physics.motion import LONGITUDINAL, Motion, motion_of
from airtruth.physics.short_period import Scale, linear_system, scale_of

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

MOST_RECORDS: Final = 12
"""Largest number of records that are simulated for a report [-]; judgement: a reader looks through a dozen."""


_LARGEST: Final = 1e6
"""Largest derivative that is simulated [1/rad] (judgement: beyond any aircraft)."""


def simulate(theta: Array, s: Scale, dt_s: float, surface_rad: Array, measured: Array) -> Array:
    """Outputs of the linear short period for a record, its initial state, trim and az offset fitted.

    Parameters
    ----------
    theta : (6,) derivatives in the order of `LONGITUDINAL.parameters` [1/rad, rates as q c/(2V)].
    s : factors of the flight condition, scalars.
    dt_s : sample period [s].
    surface_rad : (samples,) surface, linear between samples [rad].
    measured : (samples, 3) alpha [rad], q [rad/s], az [m/s2].

    Returns
    -------
    (samples, 3)
        Simulated outputs in the same units; NaN where the motion diverges.
    """
    model, surface = linear_system(theta, s), surface_rad - surface_rad[0]
    states, outputs = len(model.a), len(model.c)
    driven = np.zeros((states + 2, states + 2))  # states, surface and its rate
    driven[:states, :states], driven[:states, states] = model.a, model.b[:, 0]
    driven[states, states + 1] = 1.0
    step = expm(dt_s * driven)
    phi, early = step[:states, :states], step[:states, states]
    late = step[:states, states + 1] / dt_s  # of the change of the surface over the step
    # columns: forced motion, initial states, constants that trim the equations
    x = np.zeros((len(surface), states, 1 + 2 * states))
    x[0, :, 1 : 1 + states] = np.eye(states)
    constant = _integral(model.a, dt_s)
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(len(surface) - 1):
            x[k + 1] = phi @ x[k]
            x[k + 1, :, 0] += early * surface[k] + late * (surface[k + 1] - surface[k])
            x[k + 1, :, 1 + states :] += constant
        basis = np.einsum("oi,nij->noj", model.c, x)  # (samples, outputs, columns)
        basis[..., 0] += model.d[:, 0] * surface[:, None]
    offset = np.zeros((*basis.shape[:2], 1))
    offset[:, -1] = 1.0
    basis = np.concatenate([basis, offset], axis=2)
    if not np.isfinite(basis).all():
        return np.full_like(measured, np.nan)
    weight = 1.0 / np.maximum(measured.std(axis=0), np.finfo(np.float64).tiny)
    columns = (basis * weight[None, :, None]).reshape(len(surface) * outputs, -1)
    target = (measured * weight).reshape(-1) - columns[:, 0]
    size = np.maximum(np.linalg.norm(columns[:, 1:], axis=0), np.finfo(np.float64).tiny)
    free = np.linalg.lstsq(columns[:, 1:] / size, target, rcond=None)[0] / size
    return np.asarray(basis @ np.concatenate([[1.0], free]))


def _integral(a: Array, dt_s: float) -> Array:
    """Integral of exp(A t) over a sample period, (states, states)."""
    states = len(a)
    whole = np.zeros((2 * states, 2 * states))
    whole[:states, :states], whole[:states, states:] = a, np.eye(states)
    return np.asarray(expm(dt_s * whole)[:states, states:])


def spaced(runs: int, most: int = MOST_RECORDS) -> list[int]:
    """Numbers of evenly spaced runs, the first and the last among them."""
    return [round(k) for k in np.linspace(0, runs - 1, min(most, runs))]


def simulated_records(
    logs: Logs,
    estimates: pd.DataFrame,
    constants: AircraftConstants,
    most: int = MOST_RECORDS,
    of_runs: int | None = None,
    taken: Taken = MappingProxyType({}),
) -> Histories:
    """Records beside the simulations by each method that has an estimate of them.

    Parameters
    ----------
    logs : the identified logs.
    estimates : rows of contract 2, see `airtruth.identification.result.IdentificationResult.to_frame`.
    constants : the aircraft; mass, inertia and lengths that a log states for a run replace its own.
    most : largest number of records; of more, that many evenly spaced ones are chosen.
    of_runs : number of runs of which ``estimates`` has those to show; None if it has all.
    taken : errors of sensors that the identification took out of the records, and that are taken out here.

    Raises
    ------
    LogError, StoreError
        If a log cannot be read, or the logs lack a run of the estimates.
    """
    motion = motion_of(estimates.columns)
    methods = tuple(dict.fromkeys(estimates["method"]))
    runs = list(dict.fromkeys(estimates["run_id"]))
    joint = runs == [JOINT]
    if joint:
        runs = [run for _, log in named_logs(logs) for run in log.run_ids]
    chosen = [runs[k] for k in spaced(len(runs), most)]
    own_rows = estimates[estimates["run_id"].isin([JOINT] if joint else chosen)]
    rows = {
        (str(run), str(method)): part.iloc[0]
        for (run, method), part in own_rows.groupby(["run_id", "method"], sort=False)
    }
    found = {}
    for _, log in named_logs(logs, run_ids=chosen):
        for run in log.run_ids:
            own = {method: rows.get((JOINT if joint else run, method)) for method in methods}
            found[run] = _record(log, run, own, of_run(constants, log.metadata, run), taken, motion)
    return Histories(tuple(found[run] for run in chosen), methods, chosen[0], of_runs or len(runs))


def _record(
    log: FlightLog,
    run_id: str,
    rows: dict[str, pd.Series[float] | None],
    constants: AircraftConstants,
    taken: Taken,
    motion: Motion,
) -> History:
    at = log.rows(log.run_ids.index(run_id))
    channels = {name: values[at].astype(np.float64) for name, values in log.channels.items()}
    t_s = log.t_s[at]
    dt = float((t_s[-1] - t_s[0]) / (len(t_s) - 1))
    if taken:
        stacked = {name: values[None] for name, values in channels.items()}
        ideal = as_ideal(Batch((run_id,), dt, t_s[None], stacked), taken)
        channels, t_s = {name: values[0] for name, values in ideal.channels.items()}, ideal.t_s[0]
    batch = Batch((run_id,), dt, t_s[None], {name: values[None] for name, values in channels.items()})
    outputs = [c for c in motion.output_channels if c in channels]
    measured = np.stack([channels[c] for c in outputs], axis=1)
    airspeed, density = float(channels["airspeed_m_s"].mean()), float(air_density(channels).mean())
    own = values_of(constants, motion)
    models = {}
    for method, row in rows.items():
        y = np.full_like(measured, np.nan)
        if row is not None:
            theta = np.array([float(row[name]) for name in motion.parameters])
            if (np.abs(theta) < _LARGEST).all():
                y = _predicted(theta, own, batch, measured)
        models[method] = {c: y[:, i] for i, c in enumerate(outputs)}
    return History(
        run_id=run_id,
        group="",
        t_s=t_s,
        controls_rad={c: channels[c] for c in motion.surfaces},
        measured={c: channels[c] for c in outputs},
        models=models,
        conditions={
            "airspeed_m_s": airspeed,
            "density_kg_m3": density,
            **({"altitude_m": float(channels["altitude_m"].mean())} if "altitude_m" in channels else {}),
            "mass_kg": own.mass_kg,
            **{f"{name}_kg_m2": stated_value(own, f"{name}_kg_m2") for name in motion.inertias},
            "duration_s": float(t_s[-1] - t_s[0]),
            "sample_rate_hz": 1.0 / dt,
        },
    )


def _predicted(theta: Array, own: RecordConstants, batch: Batch, measured: Array) -> Array:
    """Simulation (samples, outputs) of a record of the motion of its constants."""
    if isinstance(own, LateralValues):
        return simulate_lateral(theta, batch, own)
    channels = {name: values[0] for name, values in batch.channels.items()}
    airspeed, density = float(channels["airspeed_m_s"].mean()), float(air_density(channels).mean())
    s = scale_of(own, airspeed, density)
    (control,) = LONGITUDINAL.surfaces
    return simulate(theta, s, batch.dt_s, channels[control], measured)


__all__ = ["MOST_RECORDS", "simulate", "simulated_records", "spaced"]
