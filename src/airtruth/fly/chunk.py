"""Fly the runs of one chunk of a campaign and write their log: the unit of work of a process."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airtruth.errors import AirtruthError
from airtruth.fly import manoeuvres, measure, streams
from airtruth.fly.engine import Condition
from airtruth.fly.flight import Flight, Inputs
from airtruth.fly.linearise import Linearisation, linearise
from airtruth.fly.plan import Plan, Row, condition, rows
from airtruth.fly.trim import Trim, trim
from airtruth.fly.with_effects import EFFECTS
from airtruth.logs import store
from airtruth.logs.flight_log import FlightLog
from airtruth.physics import dryden
from airtruth.physics.short_period import MODAL, PARAMETERS

Array = NDArray[np.float64]

_CACHED_CONDITIONS: Final = 4


@dataclass(frozen=True)
class Outcome:
    """What became of one run: status "ok" or "failed", and the reason."""

    run_id: str
    status: str
    reason: str = ""


@dataclass(frozen=True)
class Prepared:
    """A flight condition, trimmed, linearised and loaded."""

    trim: Trim
    linear: Linearisation
    flight: Flight


class Pilot:
    """Flies the runs of one plan; keeps the last few conditions loaded. One per process."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        models = {name: measure.model(sensor) for name, sensor in plan.sensors.items()}
        dynamic = measure.needs_every_step(models, 1.0 / plan.campaign.log_hz)
        self._record_every = 1 if dynamic else plan.log_every
        self._noisy = tuple(
            name for name in measure.LOGGED if name in models and models[name].noise_std > 0.0
        )
        self._models = models
        self._prepared: OrderedDict[Condition, Prepared] = OrderedDict()
        time = np.arange(plan.samples, dtype=np.float64) * plan.dt_s
        self._shapes = [manoeuvres.sample(m, time) for m in plan.manoeuvres]

    def fly_chunk(self, number: int, logs: Path, truths: Path) -> list[Outcome]:
        """Fly one chunk, write its log and its truth, and say what became of each run.

        Raises
        ------
        StoreError
            If a file cannot be written.
        """
        outcomes, truth_rows, flown = [], [], []
        for row in rows(self.plan, number):
            try:
                prepared = self._prepare(condition(row))
                channels = self.channels(row)
                outcomes.append(Outcome(row["run_id"], "ok"))
                flown.append((row, channels))
                truth_rows.append(truth_row(row, prepared))
            except AirtruthError as error:
                outcomes.append(Outcome(row["run_id"], "failed", str(error)))
                truth_rows.append(truth_row(row, None))
        if flown:
            store.write_log(
                logs / f"{number:05d}.parquet", self._log([r for r, _ in flown], [c for _, c in flown])
            )
        store.write_table(truths / f"{number:05d}.parquet", pd.DataFrame(truth_rows))
        return outcomes

    def _prepare(self, at: Condition) -> Prepared:
        found = self._prepared.pop(at, None)
        if found is None:
            plan = self.plan
            at_trim = trim(plan.aircraft, at, plan.dt_s)
            found = Prepared(
                trim=at_trim,
                linear=linearise(plan.aircraft, at_trim, plan.dt_s),
                flight=Flight(plan.aircraft, at_trim, plan.dt_s, self._record_every),
            )
        self._prepared[at] = found
        if len(self._prepared) > _CACHED_CONDITIONS:
            self._prepared.popitem(last=False)
        return found

    def channels(self, row: Row) -> dict[str, Array]:
        """Fly one run of the table; its noise-free channels, as `Flight.fly` returns them.

        Raises
        ------
        TrimError, FlightError
            If the run's condition cannot be trimmed, or the flight leaves the simulation's range.
        """
        plan = self.plan
        prepared = self._prepare(condition(row))
        gust = self._gust(prepared.trim, row)
        manoeuvre = plan.manoeuvres[int(row["manoeuvre"])]
        amplitude = 1.0 if manoeuvre.kind == "replay" else float(row["amplitude_rad"])
        gains = plan.campaign.augmentation
        inputs = Inputs(
            command_rad=amplitude * self._shapes[int(row["manoeuvre"])],
            gust_u_m_s=gust[:, 0],
            gust_w_m_s=gust[:, 1],
            gust_q_rad_s=-gust[:, 2] if plan.campaign.gust.rotary else None,
            damper_gain_s=gains.damper_gain_s,
            attitude_gain=gains.attitude_gain,
            surface=manoeuvre.surface,
        )
        if gains.damper_gain_s or gains.attitude_gain:
            inputs = replace(
                inputs,
                q_error_rad_s=self._error("q_rad_s", row),
                theta_error_rad=self._error("theta_rad", row),
            )
        return prepared.flight.fly(inputs)

    def _gust(self, at: Trim, row: Row) -> Array:
        gust, samples = self.plan.campaign.gust, self.plan.samples
        sigma_u, sigma_w = float(row["sigma_u_m_s"]), float(row["sigma_w_m_s"])
        if sigma_u == 0.0 and sigma_w == 0.0:
            return np.zeros((samples, 3))
        span = self.plan.aircraft.constants.span_m if gust.rotary else None
        unit = _unit_gust(
            float(row["length_u_m"]), float(row["length_w_m"]), at.airspeed_m_s, span, self.plan.dt_s
        )
        states = unit.phi.shape[-1]
        normals = streams.normals(self.plan.seed, int(row["run"]), streams.GUST, samples * states)
        velocities = dryden.simulate(unit, normals.reshape(1, samples, states), gust.start)[0]
        return np.asarray(velocities * np.array([sigma_u, sigma_w, sigma_w])[: velocities.shape[1]])

    def _error(self, channel: str, row: Row) -> Array:
        """Noise and bias that the augmentation's own sensor adds, the same as in the log."""
        sensor = self._models.get(channel)
        if sensor is None:
            return np.zeros(self.plan.samples)
        noise = streams.normals(self.plan.seed, int(row["run"]), streams.SENSORS[channel], self.plan.samples)
        return sensor.bias + sensor.noise_std * noise

    def _log(self, flown: list[Row], channels: list[dict[str, Array]]) -> FlightLog:
        plan, every = self.plan, self._record_every
        truth = {name: np.stack([c[name] for c in channels]) for name in channels[0]}
        noise: dict[str, Array] = {
            name: np.stack(
                [
                    streams.normals(plan.seed, int(r["run"]), streams.SENSORS[name], plan.samples)[::every]
                    for r in flown
                ]
            )
            for name in self._noisy
        }
        logged = measure.log_channels(truth, plan.sensors, noise, plan.dt_s * every, plan.log_every // every)
        samples = logged["alpha_rad"].shape[1]
        return FlightLog(
            metadata=_log_metadata(plan),
            run_ids=tuple(r["run_id"] for r in flown),
            offsets=np.arange(len(flown) + 1, dtype=np.int64) * samples,
            t_s=np.tile(np.arange(samples) / plan.campaign.log_hz, len(flown)),
            channels={name: values.ravel() for name, values in logged.items()},
        )


@lru_cache(maxsize=64)
def _unit_gust(
    length_u: float, length_w: float, airspeed: float, span: float | None, dt_s: float
) -> dryden.DiscreteGust:
    """Gusts of unit standard deviation; the rotary gust goes with w."""
    return dryden.discretise(dryden.Dryden(1.0, 1.0, length_u, length_w, airspeed, span), dt_s)


def _log_metadata(plan: Plan) -> Mapping[str, object]:
    """What a log says of itself: nothing of gusts, draws or the truth."""
    return {"aircraft": plan.aircraft.name, "sample_rate_hz": plan.campaign.log_hz}


def truth_row(row: Row, prepared: Prepared | None) -> dict[str, object]:
    """One row of truth.parquet: the declared derivatives at the run's own trim, and its air; None: it failed."""
    result: dict[str, object] = {"run_id": row["run_id"], "status": "ok" if prepared else "failed"}
    sides = {"": "plus", "_minus": "minus", "_central": "central"}
    for suffix, side in sides.items():
        values = getattr(prepared.linear, side) if prepared else np.full(len(PARAMETERS), np.nan)
        result |= {name + suffix: float(v) for name, v in zip(PARAMETERS, values, strict=True)}
    modal = (prepared.linear.wn_rad_s, prepared.linear.zeta) if prepared else (np.nan, np.nan)
    result |= dict(zip(MODAL, modal, strict=True))
    at = prepared.trim if prepared else None
    result |= {
        "trim_alpha_rad": at.alpha_rad if at else np.nan,
        "trim_elevator_rad": at.elevator_rad if at else np.nan,
        "trim_throttle": at.controls.throttle if at else np.nan,
        "airspeed_m_s": at.airspeed_m_s if at else np.nan,
        "density_kg_m3": at.density_kg_m3 if at else np.nan,
        "dynamic_pressure_pa": 0.5 * at.density_kg_m3 * at.airspeed_m_s**2 if at else np.nan,
    }
    for name in (
        "eas_m_s",
        "altitude_m",
        "wind_m_s",
        "sigma_u_m_s",
        "sigma_w_m_s",
        "length_u_m",
        "length_w_m",
    ):
        result[name] = float(row[name])
    if EFFECTS in row:
        result[EFFECTS] = row[EFFECTS]
    return result
