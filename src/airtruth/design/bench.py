"""The declared aircraft at a flight condition in JSBSim: flies an input within limits and makes a record of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.design.limits import Extremes, Limits, extremes
from airtruth.design.waveforms import START_S, multistep
from airtruth.errors import ConfigurationError, FlightError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change
from airtruth.simulation.campaign import effects as with_effects
from airtruth.simulation.campaign.file import Campaign
from airtruth.simulation.disposable import isolated, isolated_flight
from airtruth.simulation.flight import Inputs, fly_all
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.resolution import trimmed_and_linear
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.tracing.conditions import gust_length_m
from airtruth.tracing.model.plant import Plant
from airtruth.tracing.model.probed import probed
from airtruth.tracing.model.reading import read
from airtruth.tracing.model.records import TraceRecord

Array = NDArray[np.float64]

TAIL_S: Final = 1.0
"""Time from the end of an input to the end of the record [s] (judgement: the short period decays)."""
_ATTEMPTS: Final = 4
"""Flights in which an amplitude is brought within the limits [-] (judgement: the motion is nearly linear in it)."""
_WITHIN: Final = 0.995
"""Share of a limit that is aimed at where it is exceeded [-] (judgement: the next flight keeps it)."""
_TRIED_S: Final = (0.2, 0.5)
"""Units of the 3-2-1-1 whose pitch rates give the range of the tables [s] (judgement)."""
_RATE_MARGIN: Final = 1.5
"""Range of the tables' pitch rate over that of these flights [-] (judgement: an input in resonance has more)."""


@dataclass(frozen=True)
class Flown:
    """An input as flown by the declared aircraft in calm air.

    Attributes
    ----------
    manoeuvre : the input, its amplitude within the limits.
    channels : name -> (samples,) as `Flight.fly` returns them.
    reached : largest values of this flight, and of the same input with each of the hypotheses.
    record : the flight as the tracer sees it; its outputs are replaced by those of a hypothesis.
    """

    manoeuvre: Manoeuvre
    channels: Mapping[str, Array]
    reached: Extremes
    record: TraceRecord

    @property
    def t_s(self) -> Array:
        """(samples,) times [s]."""
        return self.record.signals.dt_s * np.arange(len(self.moved_rad), dtype=np.float64)

    @property
    def moved_rad(self) -> Array:
        """(samples,) surface about its trim [rad]."""
        surface = self.channels[LONGITUDINAL.surfaces[0]]
        return np.asarray(surface - surface[0])


class Bench:
    """Flies inputs at one flight condition.

    Parameters
    ----------
    aircraft : the declared aircraft, with a JSBSim model.
    campaign : simulation and log rates.
    condition : flight condition.
    limits : of the inputs and of the motion.

    Raises
    ------
    TrimError, FlightError
        If the aircraft cannot fly there.
    """

    def __init__(self, aircraft: Aircraft, campaign: Campaign, condition: Condition, limits: Limits) -> None:
        self.aircraft, self.condition, self.limits = aircraft, condition, limits
        self.dt_s = 1.0 / campaign.simulation_hz
        self.log_dt_s = 1.0 / campaign.log_hz
        every = round(campaign.simulation_hz / campaign.log_hz)
        self.trim, self.linear = trimmed_and_linear(aircraft, condition, self.dt_s)
        self._every = every
        self._simulation_hz = campaign.simulation_hz
        self._planes = [(aircraft, self.trim)]  # folders of changed aircraft exist as long as they do
        whole = round((START_S + limits.length_s + TAIL_S) * campaign.log_hz) * every
        self.duration_s = whole * self.dt_s
        self._t_s = np.arange(whole + 1, dtype=np.float64) * self.dt_s
        self.plant = self._probe()

    def allow_for(self, changes: Iterable[Change]) -> None:
        """Keep the limits of every further flight for the aircraft with each of some changes, too.

        Parameters
        ----------
        changes : of an effect each.

        Raises
        ------
        AircraftError, TrimError
            If the aircraft cannot take a change, or cannot fly with it.
        """
        for change in changes:
            flown = with_effects.aircraft(self.aircraft, change, self._simulation_hz, self.condition)
            if flown is not self.aircraft:
                at = isolated(f"the trim of {flown.name}", trim, flown, self.condition, self.dt_s)
                self._planes.append((flown, at))

    def _probe(self) -> Plant:
        """Tables over the angles that the limits allow, and the pitch rates of two flights."""
        limits, at = self.limits, self.trim
        rate = 0.0
        for unit in _TRIED_S:
            length = min(unit, limits.length_s / 7.0)
            found = self._within(multistep((3.0, 2.0, 1.0, 1.0), length, 0.0, self.dt_s))
            if found is not None:
                rate = max(rate, float(np.abs(found[1][LONGITUDINAL.gyros[0]]).max()))
        if rate == 0.0:
            raise FlightError(
                f"plan: {self.aircraft.name} leaves the range of the simulation at {self.condition.eas_m_s:g} m/s EAS "
                "with every elevator tried; lower the amplitude"
            )
        alpha = (at.alpha_rad - limits.alpha_rad, at.alpha_rad + limits.alpha_rad)
        surface = (at.elevator_rad - limits.amplitude_rad, at.elevator_rad + limits.amplitude_rad)
        return probed(self.aircraft, at, alpha, surface, rate * _RATE_MARGIN)

    def fly(self, manoeuvre: Manoeuvre, share: float = 1.0) -> Flown | None:
        """Fly an input with the largest amplitude that the limits allow; None if no flight within them succeeds.

        Parameters
        ----------
        manoeuvre : input of any amplitude.
        share : amplitude over the largest one [-].
        """
        found = self._within(manoeuvre)
        if found is not None and share < 1.0:
            made = replace(found[0], amplitude_rad=share * found[0].amplitude_rad)
            found = self._flown(made)
        if found is None:
            return None
        made, channels, reached = found
        return Flown(made, channels, reached, self._record(channels))

    def _within(self, manoeuvre: Manoeuvre) -> tuple[Manoeuvre, dict[str, Array], Extremes] | None:
        made = replace(manoeuvre, amplitude_rad=self.limits.amplitude_rad)
        for _ in range(_ATTEMPTS):
            found = self._flown(made)
            if found is None:
                made = replace(made, amplitude_rad=0.5 * made.amplitude_rad)
                continue
            share = found[2].share(self.limits)
            if share <= 1.0 + 1e-9:
                return found
            made = replace(made, amplitude_rad=made.amplitude_rad * _WITHIN / share)
        return None

    def _flown(self, manoeuvre: Manoeuvre) -> tuple[Manoeuvre, dict[str, Array], Extremes] | None:
        try:
            command = sample(manoeuvre, self._t_s)
            still = np.zeros_like(command)
            inputs = Inputs(command, still, still)
            flown = isolated_flight(
                command.size * len(self._planes),
                f"the flight of {self.aircraft.name}",
                fly_all,
                self._planes,
                inputs,
                self.dt_s,
                self._every,
            )
        except (ConfigurationError, FlightError):
            return None
        reached = [extremes(channels, self.log_dt_s) for channels in flown]
        return manoeuvre, flown[0], reduce(Extremes.and_of, reached)

    def _record(self, channels: Mapping[str, Array]) -> TraceRecord:
        samples = len(channels[LONGITUDINAL.vane])
        log = FlightLog(
            metadata={"aircraft": self.aircraft.name},
            run_ids=("plan",),
            offsets=np.array([0, samples]),
            t_s=np.arange(samples, dtype=np.float64) * self.log_dt_s,
            channels={name: values for name, values in channels.items() if name != "q_dot_rad_s2"},
        )
        (signals,) = read(log)
        return TraceRecord(signals, self.plant, gust_length_m(signals.altitude_m))


__all__ = ["TAIL_S", "Bench", "Flown"]
