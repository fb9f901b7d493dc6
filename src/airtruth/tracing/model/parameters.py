"""Layout of the tracer's vectors: common and per-record parameters, sizes of effects, states of the filter.

Every index and slice of these vectors is defined here, once, from the names of the elements.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def _span(names: tuple[str, ...], first: str, last: str) -> slice:
    """Slice from one name to another, both included."""
    return slice(names.index(first), names.index(last) + 1)


class Common:
    """Parameters that all records have in common; all are zero for the declared aircraft.

    Attributes
    ----------
    derivatives : increments of the six derivatives, in the order of `airtruth.physics.short_period.PARAMETERS` [-];
        lift, moment : their halves.
    log_noise : logarithm of the noise of alpha, q and az over the declared noise.
    rotary : share of the rotary gust less 1/2 [-]: 1/2 is all of the specification's, -1/2 is none.
    thrust : relative change of the thrust [-].
    rolloff : high-frequency rolloff of the gusts, less 1/2: -1/2 is Dryden's, 1/2 is von Karman's [-].
    inertia : relative change of the pitch inertia at equal derivatives of the pitch acceleration [-]; it changes the
        curvature of the tables alone.
    mounting : share of a shift of the CG that moves the CG past the sensors, less 1/2 [-]: 1/2 if they are bolted to the
        airframe, -1/2 if they keep their declared distance from the CG.
    colour_shares : share of the noise variance of alpha, q and az that is slow [-].
    log_colour_time : logarithm of the correlation time of the correlated noise over `COLOUR_TIME_S`.
    colour : shares and correlation time; noise : everything that describes the sensors' noise (indices).
    """

    names: Final = (
        "CLalpha",
        "CLq",
        "CLde",
        "Cmalpha",
        "Cmq",
        "Cmde",
        "log_noise_alpha",
        "log_noise_q",
        "log_noise_az",
        "rotary",
        "thrust",
        "rolloff",
        "inertia",
        "mounting",
        "colour_alpha",
        "colour_q",
        "colour_az",
        "log_colour_time",
    )
    size: Final = len(names)
    derivatives: Final = _span(names, "CLalpha", "Cmde")
    lift: Final = _span(names, "CLalpha", "CLde")
    moment: Final = _span(names, "Cmalpha", "Cmde")
    CLalpha: Final = names.index("CLalpha")
    Cmalpha: Final = names.index("Cmalpha")
    log_noise: Final = _span(names, "log_noise_alpha", "log_noise_az")
    rotary: Final = names.index("rotary")
    thrust: Final = names.index("thrust")
    rolloff: Final = names.index("rolloff")
    inertia: Final = names.index("inertia")
    mounting: Final = names.index("mounting")
    colour_shares: Final = _span(names, "colour_alpha", "colour_az")
    log_colour_time: Final = names.index("log_colour_time")
    colour: Final = _span(names, "colour_alpha", "log_colour_time")
    noise: Final = np.r_[log_noise, colour]
    nuisance: Final = slice(derivatives.stop, size)


class PerRecord:
    """Parameters that each record has for itself.

    Attributes
    ----------
    alpha, q : initial angle of attack [rad] and pitch rate [rad/s]; motion_start : both.
    gusts : initial states of Dryden's filter [-]; start : motion and gusts.
    bias : of alpha [rad], q [rad/s], az [m/s2].
    trim : increments of CL and Cm at the trim [-].
    offsets : biases and trim.
    log_gust : logarithm of the standard deviation of the vertical gust [m/s].
    deterministic : all but the gusts (indices): initial alpha and q, biases, trim.
    """

    names: Final = (
        "alpha0",
        "q0",
        "w1",
        "w2",
        "bias_alpha",
        "bias_q",
        "bias_az",
        "CL0",
        "Cm0",
        "log_sigma_w",
    )
    size: Final = len(names)
    alpha: Final = names.index("alpha0")
    q: Final = names.index("q0")
    motion_start: Final = _span(names, "alpha0", "q0")
    gusts: Final = _span(names, "w1", "w2")
    start: Final = _span(names, "alpha0", "w2")
    bias: Final = _span(names, "bias_alpha", "bias_az")
    trim: Final = _span(names, "CL0", "Cm0")
    offsets: Final = _span(names, "bias_alpha", "Cm0")
    log_gust: Final = names.index("log_sigma_w")
    deterministic: Final = np.r_[motion_start, offsets]


COMMON_STEP: Final = np.array(
    [1e-3, 1e-1, 1e-3, 1e-4, 1e-2, 1e-4]  # derivatives
    + [1e-4] * 3  # log noise
    + [1e-3] * 9
)
"""Steps of the one-sided differences in `Common` [units there]; judgement: about 1e-3 of a declared standard deviation,
large against rounding and small against the curvature of the innovations."""
PER_RECORD_STEP: Final = np.array([1e-5, 1e-4, 1e-3, 1e-3, 1e-5, 1e-4, 1e-3, 1e-5, 1e-6, 1e-4])
"""The same in `PerRecord`."""
COLOUR_TIME_S: Final = 0.1
"""Unit of the correlation time of correlated noise [s]."""
BOUNDS: Final[dict[int, tuple[float, float]]] = {
    Common.rotary: (-0.75, 0.75),
    Common.rolloff: (-0.75, 0.75),
    Common.mounting: (-0.75, 0.75),
    **dict.fromkeys(range(Common.colour_shares.start, Common.colour_shares.stop), (0.0, 0.95)),
    Common.log_colour_time: (-1.6, 1.0),
}
"""Range of the bounded common parameters [units there]; judgement. Gusts and the mounting of the sensors: none to all, and a
quarter beyond for a form that is neither of the two. Correlated noise: some white noise has to remain, and the correlation time
stays between 20 and 270 ms, because slower noise cannot be told from motion."""


@dataclass(frozen=True)
class Parameters:
    """Values of all free parameters.

    Attributes
    ----------
    common : (common,) see `Common`.
    per_record : (records, per-record) see `PerRecord`.
    sizes : (sizes,) of the effects, in their size coordinates.
    """

    common: Array
    per_record: Array
    sizes: Array

    @property
    def vector(self) -> Array:
        """All in one array: common, sizes, then the records one by one."""
        return np.concatenate([self.common, self.sizes, self.per_record.ravel()])

    @property
    def at_bounds(self) -> tuple[int, ...]:
        """Indices of the common parameters that are at an end of their range."""
        return tuple(i for i, ends in BOUNDS.items() if self.common[i] in ends)

    def with_levels(self, other: Parameters) -> Parameters:
        """The parameters with the levels of noise and gusts of others for the same records."""
        common, per_record = self.common.copy(), self.per_record.copy()
        common[Common.noise] = other.common[Common.noise]
        per_record[:, PerRecord.log_gust] = other.per_record[:, PerRecord.log_gust]
        return Parameters(common, per_record, self.sizes)

    def of_vector(self, vector: Array) -> Parameters:
        """Parameters of the same shape from such an array."""
        layout = Layout(self.sizes.size)
        return Parameters(
            vector[layout.common],
            vector[layout.marginal.stop :].reshape(self.per_record.shape),
            vector[layout.sizes],
        )


@dataclass(frozen=True)
class Layout:
    """Where the parameters of one record are among its sensitivities.

    Attributes
    ----------
    count : number of sizes.
    """

    count: int

    @property
    def common(self) -> slice:
        """Common parameters."""
        return slice(0, Common.size)

    @property
    def sizes(self) -> slice:
        """Sizes of the effects."""
        return slice(Common.size, Common.size + self.count)

    @property
    def marginal(self) -> slice:
        """Common parameters and sizes: what remains once the per-record parameters are eliminated."""
        return slice(0, Common.size + self.count)

    @property
    def per_record(self) -> slice:
        """Per-record parameters."""
        return slice(Common.size + self.count, self.total)

    @property
    def total(self) -> int:
        """Number of parameters."""
        return Common.size + self.count + PerRecord.size


def size_index(number: int) -> int:
    """Index of a size among common parameters and sizes."""
    return Common.size + number


ALPHA, Q, GUST_1, GUST_2, LATE_GUST = range(5)
"""States of the motion over ground (alpha [rad], q [rad/s]), of Dryden's filter [-], and the gust at the tail [-]."""
LEAD_COUNT: Final = 3
"""Number of low-passed copies of the first gust state, which give the gusts their rolloff [-]."""
LEAD: Final = LATE_GUST + 1
"""First of these states."""
CORE: Final = LEAD + LEAD_COUNT
"""States of the motion and the gusts; those of effects, of late sensors and of correlated noise follow [-]."""
OUTPUTS: Final = 3
"""Outputs of the filter, see `airtruth.tracing.model.compile.CHANNELS` [-]."""
AZ: Final = 2
"""Number of az among them."""
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


def effect_states(kinds: list[str]) -> tuple[Ints, int]:
    """First state of each effect with states, and the number of states up to the last.

    Parameters
    ----------
    kinds : kind of each `airtruth.physics.terms.StateTerm`: a mode has two states, others have one.
    """
    first, at = [], CORE
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
    lag, delay = np.full(OUTPUTS, -1, dtype=np.int64), np.full(OUTPUTS, -1, dtype=np.int64)
    at = motion
    for i in range(OUTPUTS):
        if lags[i] > 0.0:
            lag[i] = at
            at += 1
        if delays[i] > 0.0:
            delay[i] = at
            at += DELAY_ORDER
    noise = at if slow else -1
    return StateLayout(motion, effect, lag, delay, noise, at + (OUTPUTS if slow else 0))


__all__ = [
    "ALPHA",
    "AZ",
    "BOUNDS",
    "COLOUR_TIME_S",
    "COMMON_STEP",
    "CORE",
    "DELAY_ORDER",
    "GUST_1",
    "GUST_2",
    "LATE_GUST",
    "LEAD",
    "LEAD_COUNT",
    "OUTPUTS",
    "PER_RECORD_STEP",
    "Common",
    "Layout",
    "Parameters",
    "PerRecord",
    "Q",
    "StateLayout",
    "effect_states",
    "size_index",
    "state_layout",
]
