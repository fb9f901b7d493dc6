"""Estimates with traced effects in the model, by any method of identify.

An effect adds known increments dCL(t), dCm(t) to the coefficients: functions of the measured angle of attack,
elevator and pitch rate, or of lags and modes that these drive. The equations of motion are linear in the rest,
so that the motion is the sum of two: that of the linear aircraft under its elevator, and the response d of the
same aircraft to the increments,

    d_alpha' = d_q - lift (CLalpha d_alpha + CLq hat d_q + dCL),   d_q' = moment (Cmalpha d_alpha + Cmq hat d_q + dCm),
    d_az = -normal (CLalpha d_alpha + CLq hat d_q + dCL),

with hat = c/(2V) and the factors of eqs (2)-(4) of M. Brunot, "An Instrumental Variable Approach for Aircraft
Identification". The record less d obeys the linear model under the measured elevator, whatever the method: a
regression's instruments, an identified servo and a simulated output stay made of inputs alone.

d needs the derivatives that are to be estimated. Their error enters times the share of the motion that is d,
to first order; those of the trace serve, and the estimates themselves may serve again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from airtruth.effects.change import AeroTerm, Change, StateTerm
from airtruth.errors import ConfigurationError
from airtruth.identify import AircraftConstants, Options, identify_log
from airtruth.logs.flight_log import Batch, FlightLog, batches
from airtruth.physics import short_period
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.trace.tracing import Trace
from airtruth.trace.update import accepted_change

Array = NDArray[np.float64]

MEASURED: Final = ("alpha", "elevator", "qhat")
"""Signals of aerodynamic terms that a log measures."""
_HEAD_S: Final = 0.1
_HEAD_SAMPLES: Final = 3


@dataclass(frozen=True)
class Correction:
    """What is taken out of a log.

    Attributes
    ----------
    aero : increments of the coefficients; states : lags and modes that they may take as their signals.
    derivatives : (6,) of the aircraft that answers them, in the order of `short_period.PARAMETERS` [-].
    from_trim : whether alpha counts from the record's own trim, its mean over the first 0.1 s, as in a trace
        with the linear model.
    """

    aero: tuple[AeroTerm, ...]
    derivatives: Array
    from_trim: bool
    states: tuple[StateTerm, ...] = ()


def correction(found: Trace) -> Correction:
    """The effects that a trace accepted, with its refitted derivatives; without terms if there is none.

    Raises
    ------
    ConfigurationError
        If an effect is not an increment of CL or Cm in measured signals.
    """
    change = accepted_change(found.stages)
    check(change)
    plant = found.case.fitted.records[0].plant
    return Correction(
        aero=change.aero,
        derivatives=plant.derivatives + found.stages[-1].gls.point.shared[:6],
        from_trim=found.case.model == "linear",
        states=change.states,
    )


def check(change: Change) -> None:
    """Refuse what is not an increment of a coefficient in measured signals.

    Raises
    ------
    ConfigurationError
        Naming what it is.
    """
    used = {s.signal for s in change.states} | {t.signal for t in change.aero}
    unknown = sorted(used - {s.name for s in change.states} - set(MEASURED))
    others = [name for name in ("surface", "declared", "sensors", "air") if getattr(change, name)]
    if unknown or others:
        what = ", ".join([*(f"terms of {name}" for name in others), *(f"signal {name}" for name in unknown)])
        raise ConfigurationError(
            f"the traced effects hold {what}: only increments of CL and Cm in {', '.join(MEASURED)} can be taken "
            "out of a log; fly or identify with the updated aircraft instead"
        )


def increments(aero: Sequence[AeroTerm], signals: Mapping[str, Array]) -> Array:
    """(2, ...) dCL and dCm [-] of terms.

    Parameters
    ----------
    signals : name -> values of one shape: alpha as the terms count it [rad], elevator [rad], qhat = q c/(2V), states.
    """
    total = np.zeros((2, *next(iter(signals.values())).shape))
    for term in aero:
        s = signals[term.signal] - term.at
        shaped = {
            "linear": s,
            "quadratic": s**2,
            "above": np.maximum(s, 0.0),
            "below": np.minimum(s, 0.0),
        }[term.shape]
        total[0 if term.coefficient == "CL" else 1] += term.amplitude * shaped
    return total


def state(term: StateTerm, signal: Array, dt_s: float) -> Array:
    """A lag or a mode of a signal (runs, samples), from equilibrium, exact for a signal linear between samples."""
    time = term.time_s
    poles = [time, 1.0] if term.kind == "lag" else [time**2, 2.0 * term.damping * time, 1.0]
    b, a, _ = cont2discrete(([1.0], poles), dt_s, method="foh")
    b = b.ravel()
    start = lfilter_zi(b, a)[None, :] * signal[:, :1]
    return np.asarray(lfilter(b, a, signal, axis=1, zi=start)[0])


def response(derivatives: Array, scale: short_period.Scale, lift: Array, moment: Array, dt_s: float) -> Array:
    """Response of the linear aircraft to increments of CL and Cm, from rest, increments linear between samples.

    Parameters
    ----------
    derivatives : (6,) in the order of `short_period.PARAMETERS` [-].
    scale : factors (runs,).
    lift, moment : (runs, samples) dCL, dCm [-].
    dt_s : sample period [s].

    Returns
    -------
    (3, runs, samples) alpha [rad], q [rad/s], az [m/s2].
    """
    runs, samples = lift.shape
    every = np.broadcast_to(derivatives, (runs, 6))
    a, _ = short_period.system(every, scale)
    u = np.stack([-scale.lift[:, None] * lift, scale.moment[:, None] * moment], axis=2)
    # x' = A x + u, u' = (u1 - u0)/dt: one exponential gives the exact step (Franklin, Powell and Workman,
    # Digital Control of Dynamic Systems, 3rd ed., 1998, 6.3.2, triangle hold)
    whole = np.zeros((runs, 6, 6))
    whole[:, :2, :2] = a * dt_s
    whole[:, :2, 2:4] = np.eye(2) * dt_s
    whole[:, 2:4, 4:] = np.eye(2)
    step = expm(whole)
    driven = np.einsum("rij,rnj->rni", step[:, :2, 2:4], u[:, :-1])
    driven += np.einsum("rij,rnj->rni", step[:, :2, 4:], np.diff(u, axis=1))
    x = np.zeros((runs, samples, 2))
    for k in range(samples - 1):
        x[:, k + 1] = np.einsum("rij,rj->ri", step[:, :2, :2], x[:, k]) + driven[:, k]
    row = short_period.normal_force_row(every, scale)[:, :2]
    az = np.einsum("rj,rnj->rn", row, x) - scale.normal[:, None] * lift
    return np.stack([x[..., 0], x[..., 1], az])


def corrected_batch(batch: Batch, constants: AircraftConstants, taken: Correction) -> Batch:
    """The runs of a batch without the response to the effects; their increments at the first sample are trim."""
    channels = dict(batch.channels)
    alpha, q, airspeed = channels["alpha_rad"], channels["q_rad_s"], channels["airspeed_m_s"]
    density = (
        channels["density_kg_m3"] if "density_kg_m3" in channels else density_kg_m3(channels["altitude_m"])
    )
    scale = short_period.scale(
        constants.wing_area_m2,
        constants.chord_m,
        constants.mass_kg,
        constants.inertia_yy_kg_m2,
        airspeed.mean(axis=1),
        np.asarray(density).mean(axis=1),
    )
    trim = trim_alpha(alpha, batch.dt_s)[:, None] if taken.from_trim else 0.0
    signals = {
        "alpha": alpha - trim,
        "elevator": channels["elevator_rad"],
        "qhat": q * scale.half_chord_time[:, None],
    }
    signals |= {s.name: state(s, signals[s.signal], batch.dt_s) for s in taken.states}
    more = increments(taken.aero, signals)
    head = _head(batch.dt_s)
    more -= more[..., :head].mean(axis=2, keepdims=True)
    moved = response(taken.derivatives, scale, more[0], more[1], batch.dt_s)
    for name, d in zip(("alpha_rad", "q_rad_s", "az_m_s2"), moved, strict=True):
        channels[name] = channels[name] - d
    return replace(batch, channels=channels)


def trim_alpha(alpha: Array, dt_s: float) -> Array:
    """(runs,) angle of attack [rad] that a trace with the linear model counts from."""
    return np.asarray(alpha[:, : _head(dt_s)].mean(axis=1))


def corrected_log(log: FlightLog, constants: AircraftConstants, taken: Correction) -> FlightLog:
    """A checked log without the response to traced effects: what the linear aircraft would have logged.

    Raises
    ------
    LogError
        If the runs of a batch cannot be stacked.
    """
    channels = {name: values.astype(np.float64) for name, values in log.channels.items()}
    place = {run_id: i for i, run_id in enumerate(log.run_ids)}
    for batch in batches(replace(log, channels=channels)):
        changed = corrected_batch(batch, constants, taken)
        for name in ("alpha_rad", "q_rad_s", "az_m_s2"):
            for row, run_id in zip(changed.channels[name], batch.run_ids, strict=True):
                channels[name][log.rows(place[run_id])] = row
    return replace(log, channels=channels)


def identify_corrected(
    log: FlightLog,
    constants: AircraftConstants,
    methods: Sequence[str],
    taken: Correction,
    options: Options | None = None,
) -> pd.DataFrame:
    """Estimates with the effects in the model: `airtruth.identify.identify_log` of the corrected log.

    Intervals are those of the method: they count the effects as known.

    Raises
    ------
    LogError, ConfigurationError
        As `identify_log`.
    """
    return identify_log(corrected_log(log, constants, taken), constants, methods, options)


def _head(dt_s: float) -> int:
    return max(_HEAD_SAMPLES, int(_HEAD_S / dt_s))
