"""Fly the runs of one chunk of a campaign and write their log: the unit of work of a process."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from airtruth.errors import AirtruthError, reason
from airtruth.logs import store
from airtruth.logs.digest import sha256_of
from airtruth.logs.flight_log import PRESCRIBED, FlightLog
from airtruth.logs.names import chunk_file
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation import instruments as measure
from airtruth.simulation.campaign import streams
from airtruth.simulation.campaign.air import air_of
from airtruth.simulation.campaign.effects import EFFECTS
from airtruth.simulation.campaign.inputs import commands
from airtruth.simulation.campaign.plan import Plan, PlannedRun
from airtruth.simulation.flight import Flight, Inputs, LateralInputs
from airtruth.simulation.lateral_feedback import FED, LateralFeedback
from airtruth.simulation.linearise import Linearisation, linearise, truth_of
from airtruth.simulation.manoeuvres import LATERAL_CONTROLS, sample
from airtruth.simulation.simulator import STOPS, Condition
from airtruth.simulation.trim import Trim, trim

Array = NDArray[np.float64]

_CACHED_CONDITIONS: Final = 4
"""Flight conditions that a pilot keeps loaded (judgement: memory against the time to load a condition again)."""


OK: Final = "ok"
"""Status of a run that was flown."""
FAILED: Final = "failed"
"""Status of a run that failed by itself, and fails again whenever it is flown."""
INTERRUPTED: Final = "interrupted"
"""Status of a run whose process was killed or could not work; the next command flies it again."""


@dataclass(frozen=True)
class ChunkOrder:
    """A chunk to fly: its number and its runs."""

    chunk: int
    runs: tuple[PlannedRun, ...]


@dataclass(frozen=True)
class Outcome:
    """The end of one run: status `OK`, `FAILED` or `INTERRUPTED`, and the reason of the latter two."""

    run_id: str
    status: str
    reason: str = ""


@dataclass(frozen=True)
class FlownChunk:
    """A chunk whose runs have ended.

    Attributes
    ----------
    chunk : its number.
    runs : number of its runs.
    unflown : its runs that have no log, because they failed or were interrupted, in the order of the runs.
    log_sha256 : digest of its log; None if no run was flown.
    truth_sha256 : digest of its part of the truth; None if the chunk was interrupted.
    """

    chunk: int
    runs: int
    unflown: tuple[Outcome, ...]
    log_sha256: str | None
    truth_sha256: str | None

    @property
    def failed(self) -> int:
        """Number of runs that failed by themselves."""
        return sum(outcome.status == FAILED for outcome in self.unflown)

    @property
    def complete(self) -> bool:
        """Whether every run was flown or failed by itself."""
        return all(outcome.status != INTERRUPTED for outcome in self.unflown)


@dataclass(frozen=True)
class Prepared:
    """A flight condition, trimmed, linearised and loaded; the lateral derivatives only in six axes."""

    trim: Trim
    linear: Linearisation
    flight: Flight
    lateral: Linearisation | None = None


class Pilot:
    """Flies runs of one plan, whose table it does not read; keeps the last few conditions loaded. One per process."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        models = {name: sensor.errors() for name, sensor in plan.sensors.items()}
        self._readings = measure.readings_of(plan.aircraft)
        dynamic = measure.needs_every_step(models, 1.0 / plan.campaign.log_hz, self._readings)
        self._record_every = 1 if dynamic else plan.log_every
        self._noisy = tuple(
            name
            for name in measure.logged(plan.campaign.lateral)
            if name in models and models[name].noise_std > 0.0
        )
        self._models = models
        self._prepared: OrderedDict[Condition, Prepared] = OrderedDict()
        self._kept: list[BaseException] = []  # the destructor of an executive that failed aborts the process
        self._shapes = [[sample(m, plan.t_s) for m in inputs] for inputs in plan.inputs]

    def fly_chunk(
        self,
        order: ChunkOrder,
        logs: Path,
        truths: Path,
        crashed: Mapping[str, str] | None = None,
        starts: Callable[[str], None] = lambda run_id: None,
    ) -> FlownChunk:
        """Fly one chunk, and write its log and its truth.

        Parameters
        ----------
        order : the chunk and its runs.
        logs, truths : folders of the two files.
        crashed : runs that end their process, with the reason; they are not flown and count as failed.
        starts : receives each run before it is flown.

        Raises
        ------
        StoreError
            If a file cannot be written.
        """
        unflown, truth_rows, flown = [], [], []
        for run in order.runs:
            why = (crashed or {}).get(run.run_id)
            prepared = None
            if why is None:
                starts(run.run_id)
                try:
                    prepared = self.prepared(run.condition)
                    flown.append((run, self.channels(run)))
                except AirtruthError as error:
                    why, prepared = str(error), None
                except STOPS as error:
                    self._kept.append(error)
                    why, prepared = f"JSBSim stops with: {reason(error)}", None
            if why is not None:
                unflown.append(Outcome(run.run_id, FAILED, why))
            truth_rows.append(truth_row(run, prepared))
        log, truth = (folder / chunk_file(order.chunk) for folder in (logs, truths))
        if flown:
            store.write_log(log, self._log([r for r, _ in flown], [c for _, c in flown]))
        store.write_table(truth, pd.DataFrame(truth_rows))
        return FlownChunk(
            order.chunk,
            len(order.runs),
            tuple(unflown),
            sha256_of(log) if flown else None,
            sha256_of(truth),
        )

    def prepared(self, at: Condition) -> Prepared:
        """Return a flight condition, trimmed, linearised and loaded.

        Raises
        ------
        TrimError
            If the condition cannot be trimmed.
        """
        prepared = self._prepared.pop(at, None)
        if prepared is None:
            plan = self.plan
            known, nominal = plan.nominal or (None, None)
            at_trim = nominal if nominal and at == known else trim(plan.aircraft, at, plan.dt_s)
            prepared = Prepared(
                trim=at_trim,
                linear=linearise(plan.aircraft, at_trim, plan.dt_s),
                flight=Flight(plan.aircraft, at_trim, plan.dt_s, self._record_every),
                lateral=linearise(plan.aircraft, at_trim, plan.dt_s, LATERAL) if at.six_axes else None,
            )
        self._prepared[at] = prepared
        if len(self._prepared) > _CACHED_CONDITIONS:
            self._prepared.popitem(last=False)
        return prepared

    def channels(self, run: PlannedRun) -> dict[str, Array]:
        """Fly one run of the table and return its noise-free channels, as `Flight.fly` does.

        Raises
        ------
        TrimError, FlightError
            If the run's condition cannot be trimmed, or the flight leaves the simulation's range.
        """
        plan = self.plan
        prepared = self.prepared(run.condition)
        air = air_of(plan, run, prepared.trim.airspeed_m_s)
        flown = plan.inputs[run.manoeuvre]
        amplitudes = [run.amplitude_of(number) for number in range(len(flown))]
        command = commands(flown, self._shapes[run.manoeuvre], amplitudes)
        gains, still = plan.campaign.augmentation, np.zeros(plan.samples)
        inputs = Inputs(
            command_rad=command.get(ELEVATOR, still),
            gust_u_m_s=air.u_m_s,
            gust_w_m_s=air.w_m_s,
            rotation_rad_s=air.rotation_of(LONGITUDINAL),
            damper_gain_s=gains.damper_gain_s,
            attitude_gain=gains.attitude_gain,
            surface=flown[0].surface,
        )
        if gains.damper_gain_s or gains.attitude_gain:
            seen = (*LONGITUDINAL.gyros, "theta_rad")
            inputs = replace(inputs, errors={name: self._error(name, run) for name in seen})
        if plan.campaign.lateral:
            lateral = {name: command.get(name, still) for name in LATERAL_CONTROLS}
            turning = LateralInputs(lateral, air.v_m_s, air.rotation_of(LATERAL), self._feedback(run))
            inputs = replace(inputs, lateral=turning)
        return prepared.flight.fly(inputs)

    def _feedback(self, run: PlannedRun) -> LateralFeedback | None:
        """The yaw damper and the bank hold, which see the noise and bias of the logged sensors."""
        gains = self.plan.campaign.augmentation
        if not gains.lateral:
            return None
        p, r, phi = (self._error(name, run) for name in FED)
        return LateralFeedback(
            errors=(p, r, phi),
            yaw_damper_gain_s=gains.yaw_damper_gain_s,
            roll_damper_gain_s=gains.roll_damper_gain_s,
            bank_gain=gains.bank_gain,
            washout_s=gains.yaw_damper_washout_s,
            every=self.plan.log_every,
        )

    def _error(self, channel: str, run: PlannedRun) -> Array:
        """Noise and bias that the augmentation's own sensor adds, the same as in the log."""
        sensor = self._models.get(channel)
        if sensor is None:
            return np.zeros(self.plan.samples)
        noise = streams.normals(self.plan.seed, run.run, streams.SENSORS[channel], self.plan.samples)
        return sensor.bias + sensor.noise_std * noise

    def _log(self, flown: list[PlannedRun], channels: list[dict[str, Array]]) -> FlightLog:
        plan, every = self.plan, self._record_every
        truth = {name: np.stack([c[name] for c in channels]) for name in channels[0]}
        noise = {name: np.empty_like(truth[name]) for name in self._noisy}
        for row, run in enumerate(flown):
            for name, own in noise.items():
                drawn = streams.normals(plan.seed, run.run, streams.SENSORS[name], plan.samples)
                own[row] = drawn[::every]
        logged = measure.log_channels(
            truth, self._models, noise, plan.dt_s * every, plan.log_every // every, self._readings
        )
        samples = logged[LONGITUDINAL.vane].shape[1]
        return FlightLog(
            metadata=_log_metadata(plan),
            run_ids=tuple(run.run_id for run in flown),
            offsets=np.arange(len(flown) + 1, dtype=np.int64) * samples,
            t_s=np.tile(np.arange(samples) / plan.campaign.log_hz, len(flown)),
            channels={name: values.ravel() for name, values in logged.items()},
        )


@dataclass(frozen=True)
class FlownRun:
    """A single run that was flown: trim, derivatives, those of the lateral motion in six axes, and noise-free channels."""

    trim: Trim
    linear: Linearisation
    lateral: Linearisation | None
    channels: dict[str, Array]


def flown_runs(plan: Plan, runs: Sequence[PlannedRun]) -> list[FlownRun]:
    """Fly single runs of a plan.

    Raises
    ------
    TrimError, FlightError
        As `Pilot.channels`.
    """
    pilot = Pilot(plan)
    prepared = ((run, pilot.prepared(run.condition)) for run in runs)
    return [FlownRun(at.trim, at.linear, at.lateral, pilot.channels(run)) for run, at in prepared]


def _log_metadata(plan: Plan) -> Mapping[str, object]:
    """Metadata of a log, without gusts, draws or the truth."""
    known: dict[str, object] = {"aircraft": plan.aircraft.name, "sample_rate_hz": plan.campaign.log_hz}
    if all(inputs[0].surface for inputs in plan.inputs):
        known[PRESCRIBED] = True
    return known


def truth_row(run: PlannedRun, prepared: Prepared | None) -> dict[str, object]:
    """Return a row of truth.parquet: the declared derivatives at the run's own trim, and its air.

    Parameters
    ----------
    run : the planned run; one in six axes has the lateral derivatives and modes as well.
    prepared : its flight condition; None for a run that failed.
    """
    result: dict[str, object] = {"run_id": run.run_id, "status": "ok" if prepared else "failed"}
    at = prepared.trim if prepared else None
    result |= truth_of(LONGITUDINAL, prepared.linear if prepared else None, at)
    result |= {
        "trim_throttle": at.controls.throttle if at else np.nan,
        "airspeed_m_s": at.airspeed_m_s if at else np.nan,
        "density_kg_m3": at.density_kg_m3 if at else np.nan,
        "dynamic_pressure_pa": 0.5 * at.density_kg_m3 * at.airspeed_m_s**2 if at else np.nan,
    }
    if run.condition.six_axes:
        result |= truth_of(LATERAL, prepared.lateral if prepared else None, at)
    for name in (
        "eas_m_s",
        "altitude_m",
        "wind_m_s",
        "sigma_u_m_s",
        "sigma_w_m_s",
        "length_u_m",
        "length_w_m",
        *(("sigma_v_m_s", "length_v_m") if run.condition.six_axes else ()),
    ):
        result[name] = getattr(run, name)
    if run.effects is not None:
        result[EFFECTS] = run.effects
    return result
