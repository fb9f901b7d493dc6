"""Layout of the tracer's vectors: common and per-record parameters, sizes of effects, states of the filter.

Every index and slice of these vectors follows from a motion, with name, unit, step, range and prior of each entry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.motion import LONGITUDINAL, Motion

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class FreeEntry:
    """One free parameter.

    Attributes
    ----------
    name, unit : of the parameter; "-" for none.
    step : of the one-sided differences [unit]; judgement: about 1e-3 of a declared standard deviation, large against rounding
        and small against the curvature of the innovations.
    bounds : its range [unit]; None for none.
    std : standard deviation of its prior about zero [unit] (judgement); None where `airtruth.tracing.model.settings` states one.
    """

    name: str
    unit: str
    step: float
    bounds: tuple[float, float] | None = None
    std: float | None = None


class Entries:
    """The entries of a vector of parameters, by name.

    Attributes
    ----------
    names, size : of the entries.
    step : (size,) steps of the one-sided differences [units of the entries].
    bounds : index of a bounded entry -> its range.
    std : index of an entry with a prior of its own -> standard deviation.
    """

    def __init__(self, entries: Sequence[FreeEntry]) -> None:
        self.names = tuple(entry.name for entry in entries)
        self.size = len(entries)
        self.step = np.array([entry.step for entry in entries])
        self.bounds = {i: e.bounds for i, e in enumerate(entries) if e.bounds is not None}
        self.std = {i: e.std for i, e in enumerate(entries) if e.std is not None}

    def index(self, name: str) -> int:
        """Position of an entry.

        Raises
        ------
        ValueError
            If there is none of this name.
        """
        return self.names.index(name)

    def span(self, first: str, last: str) -> slice:
        """Slice from one name to another, both included."""
        return slice(self.index(first), self.index(last) + 1)


_PART: Final = (1e-3, (-0.75, 0.75), 0.5)
"""Step, range and prior of a share less 1/2 [-] (judgement): none to all, and a quarter beyond for a form that is neither of the
two. The share of a gust of its own is at least a twentieth: its variance is even in the share, without a slope at zero."""
_STEPS: Final = {"rad": 1e-5, "rad_s": 1e-4, "m_s2": 1e-3}
"""Unit of a channel -> step of its bias and of its initial value [unit] (judgement)."""


class CommonEntries(Entries):
    """Parameters that all records have in common; all are zero for the declared aircraft.

    Attributes
    ----------
    derivatives : increments of the derivatives, in the order of the motion [-].
    log_noise : logarithm of the noise of each output over the declared noise.
    rotary : share of the rotary gust less 1/2 [-]: 1/2 is all of the specification's, -1/2 is none.
    thrust : relative change of the thrust [-].
    rolloff : high-frequency rolloff of the gusts, less 1/2: -1/2 is Dryden's, 1/2 is von Karman's [-].
    inertia : relative change of the inertia at equal derivatives of the angular acceleration [-]; it changes the curvature of
        the tables alone.
    mounting : share of a shift of the CG that moves the CG past the sensors, less 1/2 [-]: 1/2 if they are bolted to the
        airframe, -1/2 if they keep their declared distance from the CG.
    colour_shares : share of the noise variance of each output that is slow [-]; some white noise has to remain.
    log_colour_time : logarithm of the correlation time of the correlated noise over `COLOUR_TIME_S`: 20 to 270 ms, because
        slower noise cannot be told from motion.
    colour : shares and correlation time; noise : everything that describes the sensors' noise (indices).
    nuisance : all but the derivatives.
    """

    def __init__(self, motion: Motion) -> None:
        outputs = [output.name for output in motion.outputs]
        force_or_moment = [1e-3 if c.length is None else 1e-4 for c in motion.coefficients]
        angle_or_rate = [1.0 if s.length is None else 100.0 for s in motion.signals]
        super().__init__(
            [
                *(
                    FreeEntry(d.name, d.unit, force_or_moment[d.row] * angle_or_rate[d.column])
                    for d in motion.derivatives
                ),
                *(FreeEntry(f"log_noise_{name}", "-", 1e-4) for name in outputs),
                FreeEntry("rotary", "-", 1e-3, (-0.45 if "p" in motion.gusts else -0.75, 0.75), 0.5),
                FreeEntry("thrust", "-", 1e-3),
                FreeEntry("rolloff", "-", *_PART),
                FreeEntry("inertia", "-", 1e-3),
                FreeEntry("mounting", "-", *_PART),
                *(FreeEntry(f"colour_{name}", "-", 1e-3, (0.0, 0.95), 0.5) for name in outputs),
                FreeEntry("log_colour_time", "-", 1e-3, (-1.6, 1.0), 0.7),
            ]
        )
        first, last = outputs[0], outputs[-1]
        self.derivatives = slice(0, len(motion.derivatives))
        self.log_noise = self.span(f"log_noise_{first}", f"log_noise_{last}")
        self.rotary, self.thrust, self.rolloff = map(self.index, ("rotary", "thrust", "rolloff"))
        self.inertia, self.mounting = map(self.index, ("inertia", "mounting"))
        self.colour_shares = self.span(f"colour_{first}", f"colour_{last}")
        self.log_colour_time = self.index("log_colour_time")
        self.colour = self.span(f"colour_{first}", "log_colour_time")
        self.noise = np.r_[self.log_noise, self.colour]
        self.nuisance = slice(self.derivatives.stop, self.size)


class RecordEntries(Entries):
    """Parameters that each record has for itself.

    Attributes
    ----------
    motion_start : initial values of the states [their units].
    gusts : initial states of the gust's filter [-]; start : motion and gusts.
    bias : of each output [its unit]; trim : increments of the coefficients at the trim [-]; offsets : both.
    log_gust : logarithm of the standard deviation of the gust [m/s].
    mean_gust : mean gust over the airspeed, up [rad] and along the path [-], where the angle of attack is a known input.
    deterministic : all but the gusts (indices): initial states, biases, trim, mean gust.
    """

    def __init__(self, motion: Motion) -> None:
        states, outputs, coefficients = motion.states, motion.outputs, motion.coefficients
        gust = motion.gusts[0]
        super().__init__(
            [
                *(FreeEntry(f"{x.name}0", unit := _unit(x.channel), _STEPS[unit]) for x in states),
                *(FreeEntry(f"{gust}{i}", "-", 1e-3) for i in (1, 2)),
                *(FreeEntry(f"bias_{y.name}", unit := _unit(y.channel), _STEPS[unit]) for y in outputs),
                *(FreeEntry(f"{c.name}0", "-", 1e-5 if c.length is None else 1e-6) for c in coefficients),
                FreeEntry(f"log_sigma_{gust}", "-", 1e-4),
                *(FreeEntry("upwash", "rad", 1e-4) for _ in motion.known_signals),
                *(FreeEntry("tailwind", "-", 1e-4) for _ in motion.known_signals),
            ]
        )
        self.motion_start, self.gusts = slice(0, len(states)), self.span(f"{gust}1", f"{gust}2")
        self.start = slice(0, self.gusts.stop)
        self.bias = slice(self.start.stop, self.start.stop + len(outputs))
        self.trim = slice(self.bias.stop, self.bias.stop + len(coefficients))
        self.offsets = slice(self.bias.start, self.trim.stop)
        self.log_gust = self.index(f"log_sigma_{gust}")
        self.mean_gust = slice(self.log_gust + 1, self.size)
        self.deterministic = np.r_[self.motion_start, self.offsets, self.mean_gust]


def _unit(channel: str) -> str:
    """Unit in the name of a channel."""
    return next(unit for unit in sorted(_STEPS, key=len, reverse=True) if channel.endswith(f"_{unit}"))


class ParameterLayout:
    """The parameters of a motion: those of all records and those of each record.

    Attributes
    ----------
    common, per_record : entries of the vectors.
    """

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.common, self.per_record = CommonEntries(motion), RecordEntries(motion)


SHORT_PERIOD: Final = ParameterLayout(LONGITUDINAL)
"""Parameters of the short period."""
COLOUR_TIME_S: Final = 0.1
"""Unit of the correlation time of correlated noise [s]."""


@dataclass(frozen=True)
class Parameters:
    """Values of all free parameters.

    Attributes
    ----------
    common : (common,) see `CommonEntries`.
    per_record : (records, per-record) see `RecordEntries`.
    sizes : (sizes,) of the effects, in their size coordinates.
    of : entries of the vectors.
    """

    common: Array
    per_record: Array
    sizes: Array
    of: ParameterLayout = SHORT_PERIOD

    @property
    def layout(self) -> Layout:
        """Where the parameters of one record are."""
        return Layout(self.of, self.sizes.size)

    @property
    def vector(self) -> Array:
        """All in one array: common, sizes, then the records one by one."""
        return np.concatenate([self.common, self.sizes, self.per_record.ravel()])

    @property
    def at_bounds(self) -> tuple[int, ...]:
        """Indices of the common parameters that are at an end of their range."""
        return tuple(i for i, ends in self.of.common.bounds.items() if self.common[i] in ends)

    def with_levels(self, other: Parameters) -> Parameters:
        """The parameters with the levels of noise and gusts of others for the same records."""
        common, per_record = self.common.copy(), self.per_record.copy()
        common[self.of.common.noise] = other.common[self.of.common.noise]
        level = self.of.per_record.log_gust
        per_record[:, level] = other.per_record[:, level]
        return replace(self, common=common, per_record=per_record)

    def of_vector(self, vector: Array) -> Parameters:
        """Parameters of the same shape from such an array."""
        layout = self.layout
        return replace(
            self,
            common=vector[layout.common],
            per_record=vector[layout.marginal.stop :].reshape(self.per_record.shape),
            sizes=vector[layout.sizes],
        )


@dataclass(frozen=True)
class Layout:
    """Where the parameters of one record are among its sensitivities.

    Attributes
    ----------
    of : entries of the vectors.
    count : number of sizes.
    """

    of: ParameterLayout
    count: int

    @property
    def common(self) -> slice:
        """Common parameters."""
        return slice(0, self.of.common.size)

    @property
    def sizes(self) -> slice:
        """Sizes of the effects."""
        first = self.of.common.size
        return slice(first, first + self.count)

    def size(self, number: int) -> int:
        """Index of a size."""
        return self.of.common.size + number

    @property
    def marginal(self) -> slice:
        """Common parameters and sizes: what remains once the per-record parameters are eliminated."""
        return slice(0, self.sizes.stop)

    @property
    def per_record(self) -> slice:
        """Per-record parameters."""
        return slice(self.sizes.stop, self.total)

    @property
    def total(self) -> int:
        """Number of parameters."""
        return self.of.common.size + self.count + self.of.per_record.size


GUST_1: Final = len(LONGITUDINAL.states)
"""First of the two states of Dryden's filter, behind those of the short period; the gust at the tail follows [-]."""
LEAD_COUNT: Final = 3
"""Number of low-passed copies of the first gust state, which give the gusts their rolloff [-]."""
LEAD: Final = GUST_1 + 3
"""First of these states."""
CORE: Final = LEAD + LEAD_COUNT
"""States of the motion and the gusts; those of effects, of late sensors and of correlated noise follow [-]."""
OUTPUTS: Final = len(LONGITUDINAL.outputs)
"""Outputs of the short period, see `airtruth.tracing.model.compile.CHANNELS` [-]."""
DELAY_ORDER: Final = 8
"""States of a delay [-]. Judgement: two states bend the highest frequencies of von Karman gusts (a delay of 60 ms was
estimated 3 ms long); eight keep the phase to one degree up to 11 rad."""


class StateLayout(NamedTuple):
    """Where each state is; compiled code reads it too.

    Attributes
    ----------
    motion : number of states of the motion, the gusts and the effects, which are integrated together.
    effect : (effects with states,) first state of each.
    lag, delay : (outputs,) first state of a sensor's lag and delay; -1 for none.
    noise : first state of the sensors' correlated noise; -1 for none.
    size : number of states.
    """

    motion: int
    effect: Ints
    lag: Ints
    delay: Ints
    noise: int
    size: int


def lead_of(states: int) -> int:
    """First low-passed copy of a gust state, behind the states of the motion, of the gust's filter and the late gust."""
    return states + LEAD - GUST_1


def core_of(states: int) -> int:
    """Number of states of a motion, of the gust's filter, of the late gust and of the low-passed copies."""
    return states + CORE - GUST_1


def core_states(motion: Motion) -> int:
    """Number of states of a motion and its gusts, the roll gust included."""
    return core_of(len(motion.states)) + ("p" in motion.gusts)


def effect_states(kinds: list[str], motion: Motion = LONGITUDINAL) -> tuple[Ints, int]:
    """First state of each effect with states, and the number of states up to the last.

    Parameters
    ----------
    kinds : kind of each `airtruth.physics.terms.StateTerm`: a mode has two states, others have one.
    motion : whose states precede them.
    """
    first, at = [], core_states(motion)
    for kind in kinds:
        first.append(at)
        at += 2 if kind == "mode" else 1
    return np.array(first, dtype=np.int64), at


def state_layout(effect: Ints, motion: int, lags: Array, delays: Array, slow: bool) -> StateLayout:
    """States behind those of the motion: for each sensor its lag, then its delay; then the correlated noise.

    Parameters
    ----------
    effect, motion : see `effect_states`.
    lags, delays : (outputs,) of the sensors [s]; 0 for none.
    slow : whether the sensors have correlated noise.
    """
    outputs = len(lags)
    lag, delay = np.full(outputs, -1, dtype=np.int64), np.full(outputs, -1, dtype=np.int64)
    at = motion
    for i in range(outputs):
        if lags[i] > 0.0:
            lag[i] = at
            at += 1
        if delays[i] > 0.0:
            delay[i] = at
            at += DELAY_ORDER
    noise = at if slow else -1
    return StateLayout(motion, effect, lag, delay, noise, at + (outputs if slow else 0))


__all__ = [
    "COLOUR_TIME_S",
    "CORE",
    "DELAY_ORDER",
    "GUST_1",
    "LEAD",
    "LEAD_COUNT",
    "OUTPUTS",
    "SHORT_PERIOD",
    "CommonEntries",
    "Entries",
    "FreeEntry",
    "Layout",
    "ParameterLayout",
    "Parameters",
    "RecordEntries",
    "StateLayout",
    "core_of",
    "core_states",
    "effect_states",
    "lead_of",
    "state_layout",
]
