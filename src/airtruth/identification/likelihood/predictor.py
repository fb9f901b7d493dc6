"""The short period in moving air, as a list of terms from which a Kalman predictor is built.

A predictor is data: names of states, inputs, outputs and parameters, and the terms that enter products of
parameters in its matrices. Whatever else moves or measures (a lag, an arm, another input) is more states,
inputs or terms; the filter that runs it does not change.

Sources: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", eqs (2), (3), for the
aircraft; MIL-F-8785C, 3.7.1.2 (Dryden form, no rotary gust) for the air.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, choices
from airtruth.physics.linear_model import Structure, places
from airtruth.physics.motion import LONGITUDINAL, Motion
from airtruth.physics.motion_parts import Derivative
from airtruth.physics.short_period import Scale, structure
from airtruth.units import G0

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MATRICES: Final = ("A", "B", "C", "D", "Q", "R")
"""Names of the matrices."""
LEVELS: Final = ("sigma_u", "sigma_w")
"""Names of the gusts' standard deviations [m/s]."""
AIRSPEED: Final = "airspeed"
"""Name of the airspeed among the outputs."""
OUTPUTS: Final = (*(output.name for output in LONGITUDINAL.outputs), AIRSPEED)
"""Names of the outputs."""

_W1: Final = math.sqrt(1.5)
"""Share of the state w1 in the gust w over sigma_w [-]: MIL-F-8785C, 3.7.1.2, in states of unit variance."""
_W2: Final = math.sqrt(1.5) * (1.0 / math.sqrt(3.0) - 1.0)
"""Share of the state w2 [-], likewise."""


W_SHARES: Final = {"w1": _W1, "w2": _W2}
"""Shares of the two states of a transverse gust in it, over its standard deviation [-]."""
_FLOOR: Final = 1e-5
"""Least noise of every output over its spread [-]; judgement: a record without noise has no likelihood."""
W_START: Final = ((1.0, 0.5), (0.5, 0.5))
"""Covariance of these states in a stationary gust [-]."""


@dataclass(frozen=True)
class Term:
    """One product in a matrix of x' = A x + B u + noise (Q), y = C x + D u + bias + noise (R).

    Attributes
    ----------
    matrix : one of `MATRICES`; Q (intensity per second) and R (variance per sample) are diagonal.
    row : state (A, B, Q) or output (C, D, R).
    column : state (A, C) or input (B, D); "" for Q and R.
    coefficient : a number, or one per run (runs,); units of the entry over those of the parameters.
    parameters : names of the parameters that multiply it, at most two.
    """

    matrix: str
    row: str
    column: str
    coefficient: Array | float
    parameters: tuple[str, ...] = ()


@dataclass(frozen=True)
class Predictor:
    """A linear stochastic system with constant biases at its outputs.

    Attributes
    ----------
    states, inputs, outputs : names.
    parameters : names; those in ``logarithmic`` are estimated by their logarithms and stay positive.
    terms : elements of the matrices.
    start : covariances of the means of the initial states that are not free, by groups of states:
        ((names, (k, k) covariance), ...). The other states start anywhere.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    logarithmic: tuple[str, ...]
    terms: tuple[Term, ...]
    start: tuple[tuple[tuple[str, ...], tuple[tuple[float, ...], ...]], ...] = ()


@dataclass(frozen=True)
class LevelLayout:
    """A predictor as arrays, which the compiled filter reads.

    Attributes
    ----------
    location : (terms, 5) matrix (0 system matrix [[A, B], [C, D]], 1 Q, 2 R); row; column; the indices of two
        parameters, -1 for none.
    coefficient : (runs, terms).
    logarithmic : (parameters,) 1 where the logarithm is estimated.
    moves : (parameters,) 1 where a parameter acts on A, B or Q, so that the step changes.
    precision : (states, states) inverse covariance of the mean of the initial state; 0 where free.
    sizes : states, inputs, outputs, parameters.
    """

    location: Ints
    coefficient: Array
    logarithmic: Ints
    moves: Ints
    precision: Array
    sizes: tuple[int, int, int, int]


class Action(NamedTuple):
    """A derivative that acts on the rate of a state or on an output.

    Attributes
    ----------
    matrices : where a state, and where an input acts on that row: "AB" or "CD".
    row : state or output; derivative : of a motion.
    factor : (runs,) per derivative and per signal [units of the row over those of the signal].
    """

    matrices: str
    row: str
    derivative: Derivative
    factor: Array


def actions(motion: Motion, own: Structure, outputs: Sequence[str]) -> Iterator[Action]:
    """Where each derivative of a motion acts: on rates of states, then on those of some outputs."""
    states = tuple(state.name for state in motion.states)
    every = tuple(output.name for output in motion.outputs)
    for derivative in motion.derivatives:
        rate = own.rates[..., derivative.column]
        for matrices, rows, factors in (("AB", states, own.forces), ("CD", every, own.accelerations)):
            for i, row in enumerate(rows):
                factor = factors[..., i, derivative.row] * rate
                if factor.any() and (matrices == "AB" or row in outputs):
                    yield Action(matrices, row, derivative, factor)


def linear_terms(
    motion: Motion, own: Structure, outputs: Sequence[str], acting: Iterable[Action]
) -> list[Term]:
    """Terms of a motion in still air: kinematics, outputs that are states, and derivatives with their signals."""
    states, controls = ([x.name for x in each] for each in (motion.states, motion.controls))
    made = [
        Term("A", row, column, own.kinematics[..., i, j])
        for i, row in enumerate(states)
        for j, column in enumerate(states)
        if own.kinematics[..., i, j].any()
    ]
    made += [Term("C", name, name, 1.0) for name in states if name in outputs]
    for matrices, row, derivative, factor in acting:
        is_state, number = places(motion)[derivative.column]
        matrix, names = (matrices[0], states) if is_state else (matrices[1], controls)
        made.append(Term(matrix, row, names[number], factor, (derivative.name,)))
    return made


def gust_terms(
    motion: Motion,
    acting: Iterable[Action],
    outputs: Sequence[str],
    airspeed_m_s: Array,
    length_m: float,
    level: str,
) -> list[Term]:
    """A transverse gust, the states `W_SHARES`: it acts as the flow angle gust/V does, and the vane reads it.

    Parameters
    ----------
    acting : of the derivatives of the motion.
    airspeed_m_s : (runs,) [m/s]; length_m : scale length of the gust [m]; level : parameter of its standard deviation [m/s].
    """
    a, (first, second) = airspeed_m_s / length_m, W_SHARES
    made = [Term("A", first, first, -a), Term("A", second, second, -a), Term("A", second, first, a)]
    made.append(Term("Q", first, "", 2.0 * a))
    by_flow = [x for x in acting if motion.signals[x.derivative.column].name == motion.flow]
    for state, share in W_SHARES.items():
        made += [
            Term(x.matrices[0], x.row, state, x.factor * share / airspeed_m_s, (x.derivative.name, level))
            for x in by_flow
        ]
        if motion.flow in outputs:
            made.append(Term("C", motion.flow, state, share / airspeed_m_s, (level,)))
    return made


def short_period(
    scale: Scale, length_u_m: float, length_w_m: float, outputs: Sequence[str] = OUTPUTS[:-1]
) -> Predictor:
    """The linear short period with Dryden gusts u and w.

    States alpha (of the flight path over ground), q, and gusts of unit variance: u, and w1, w2 with
    w = sigma_w sqrt(3/2) (w1 + (1/sqrt 3 - 1) w2), w1' = -a w1 + noise, w2' = -a w2 + a w1, a = V/Lw.
    The air acts through alpha + w/V, and u, an increase of airspeed, through the dynamic pressure of the
    trimmed aircraft: its lift, m g, grows by 2 u/V, its moment is zero. Changes of airspeed by the
    aircraft's own motion are part of u.

    Parameters
    ----------
    scale : factors of shape (runs,).
    length_u_m, length_w_m : scale lengths of the gusts [m].
    outputs : some of `OUTPUTS`; alpha [rad], q [rad/s], az [m/s2], airspeed [m/s].

    Returns
    -------
    The predictor; parameters are the six derivatives, the gusts' standard deviations sigma_u and sigma_w
    [m/s] and noise_NAME of each output [unit of the output].

    Raises
    ------
    ConfigurationError
        If an output is not known.
    """
    for name in outputs:
        if name not in OUTPUTS:
            raise ConfigurationError(f"output {name!r} of the filter: {choices(name, OUTPUTS)}")
    v, own, (along, transverse) = scale.airspeed_m_s, structure(scale), LEVELS
    acting = list(actions(LONGITUDINAL, own, outputs))
    terms = [
        *linear_terms(LONGITUDINAL, own, outputs, acting),
        *gust_terms(LONGITUDINAL, acting, outputs, v, length_w_m, transverse),
        Term("A", "u", "u", -v / length_u_m),
        Term("Q", "u", "", 2.0 * v / length_u_m),
        Term("A", LONGITUDINAL.flow, "u", -2.0 * G0 / v**2, (along,)),
        Term("C", LONGITUDINAL.outputs[-1].name, "u", -2.0 * G0 / v, (along,)),
        Term("C", AIRSPEED, "u", 1.0, (along,)),
    ]
    terms += [Term("R", name, "", 1.0, (f"noise_{name}",) * 2) for name in outputs]
    levels = (*LEVELS, *(f"noise_{name}" for name in outputs))
    return Predictor(
        states=(*(state.name for state in LONGITUDINAL.states), "u", *W_SHARES),
        inputs=tuple(control.name for control in LONGITUDINAL.controls),
        outputs=tuple(outputs),
        parameters=(*LONGITUDINAL.parameters, *levels),
        logarithmic=levels,
        terms=tuple(t for t in terms if t.matrix not in "CDR" or t.row in outputs),
        start=((("u",), ((1.0,),)), (tuple(W_SHARES), W_START)),
    )


def floor_terms(outputs: Sequence[str], y: Array) -> list[Term]:
    """Least variance of the noise of measured outputs (runs, samples, outputs)."""
    floor = _FLOOR * y.std(axis=1)
    return [Term("R", name, "", floor[:, i] ** 2) for i, name in enumerate(outputs)]


def extended(
    predictor: Predictor,
    terms: Sequence[Term],
    states: Sequence[str] = (),
    inputs: Sequence[str] = (),
    parameters: Sequence[str] = (),
    logarithmic: Sequence[str] = (),
) -> Predictor:
    """The predictor with more terms, and the states (free to start anywhere), inputs and parameters they use.

    ``logarithmic`` are those of the parameters that are estimated by their logarithm.
    """
    return Predictor(
        states=(*predictor.states, *states),
        inputs=(*predictor.inputs, *inputs),
        outputs=predictor.outputs,
        parameters=(*predictor.parameters, *parameters),
        logarithmic=(*predictor.logarithmic, *logarithmic),
        terms=(*predictor.terms, *terms),
        start=predictor.start,
    )


def layout(predictor: Predictor, runs: int) -> LevelLayout:
    """Resolve names to indices.

    Raises
    ------
    ConfigurationError
        If a term names a matrix, state, input, output or parameter that the predictor does not have.
    """
    p, n = predictor, len(predictor.states)
    sides = {"A": (p.states, p.states), "B": (p.states, p.inputs), "C": (p.outputs, p.states)}
    sides |= {"D": (p.outputs, p.inputs), "Q": (p.states, ("",)), "R": (p.outputs, ("",))}
    kind = {"Q": 1, "R": 2}
    location = np.full((len(p.terms), 5), -1, dtype=np.int64)
    coefficient = np.empty((runs, len(p.terms)))
    moves = np.zeros(len(p.parameters), dtype=np.int64)
    for i, term in enumerate(p.terms):
        rows, columns = sides[_known(term.matrix, MATRICES, term)]
        location[i, 0] = kind.get(term.matrix, 0)
        location[i, 1] = rows.index(_known(term.row, rows, term)) + (n if term.matrix in "CD" else 0)
        location[i, 2] = columns.index(_known(term.column, columns, term)) + (n if term.matrix in "BD" else 0)
        for j, name in enumerate(term.parameters):
            location[i, 3 + j] = p.parameters.index(_known(name, p.parameters, term))
            if term.matrix in "ABQ":
                moves[location[i, 3 + j]] = 1
        coefficient[:, i] = term.coefficient
    precision = np.zeros((n, n))
    for names, covariance in p.start:
        index = [p.states.index(name) for name in names]
        precision[np.ix_(index, index)] = np.linalg.inv(np.array(covariance))
    logarithmic = np.array([int(name in p.logarithmic) for name in p.parameters], dtype=np.int64)
    sizes = (n, len(p.inputs), len(p.outputs), len(p.parameters))
    return LevelLayout(location, coefficient, logarithmic, moves, precision, sizes)


def _known(name: str, allowed: Sequence[str], term: Term) -> str:
    if name not in allowed:
        raise ConfigurationError(
            f"predictor term {term.matrix}[{term.row}, {term.column}]: {name!r} is not known; "
            f"{choices(name, allowed)}"
        )
    return name
