"""The lateral-directional motion in moving air as a predictor: terms from the motion, records from a batch.

States are beta, p, r, phi and two of the gust v, whose sideslip v/V acts through the aerodynamics and on the vane, and not on
the inertial path. White noise drives p' and r': what the linear moments do not explain. Its intensity is estimated: set to
zero, intervals are too narrow wherever the aerodynamics are not linear. With v = V(t)/V0 and p = q_bar(t)/q_bar0, forces and
moments act p times on angles and p/v times on rates; the surplus over the reference is made of measured signals and enters as
a known input, as do the products of rates and the changes of alpha, theta and gravity. So do the terms of
`airtruth.identification.lateral.observation.nonlinear`, with a factor of their own in each coefficient.

Sources: V. Klein and E. A. Morelli, Aircraft System Identification, AIAA, 2006, 3.2; MIL-F-8785C, 3.7.1.2 (Dryden form).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.lateral.observation import (
    CONTROLS,
    REGRESSORS,
    Known,
    change_of_attack,
    condition_of,
    known_inputs,
    nonlinear,
    nonlinear_columns,
    steady_flight,
)
from airtruth.identification.likelihood.fit import Records
from airtruth.identification.likelihood.kalman_kernel import KalmanSignals
from airtruth.identification.likelihood.predictor import (
    W_SHARES,
    W_START,
    Predictor,
    Term,
    actions,
    extended,
    floor_terms,
    gust_terms,
    layout,
    linear_terms,
)
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch
from airtruth.numerics.intersample import servo_bend, smooth_bend
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.atmosphere import air_density
from airtruth.physics.lateral import LateralConstants, LateralScale, structure
from airtruth.physics.motion import LATERAL
from airtruth.physics.motion_parts import Derivative
from airtruth.units import G0

Array = NDArray[np.float64]

OUTPUTS: Final = tuple(output.name for output in LATERAL.outputs)
"""Outputs of the predictor."""
GUST: Final = "sigma_v"
"""Standard deviation of the gust v [m/s]."""
PROCESS: Final = ("noise_p_dot", "noise_r_dot")
"""Intensities of the noise in p' and r' [rad/s per root second]."""
KINEMATIC: Final = tuple(f"known_{state.name}" for state in LATERAL.states)
"""Known inputs of the rates of the states: kinematics and inertia beyond the linear model."""
SURPLUS: Final = tuple(f"surplus_{signal.name}" for signal in LATERAL.signals)
"""Known inputs: each signal times the surplus of the dynamic pressure."""
TERM: Final = "term_{}_{}"
"""Known input: a nonlinear term by its name and the name of its signal."""


def levels(outputs: tuple[str, ...], *, gusts: bool) -> tuple[str, ...]:
    """Names of the levels: of output error the noise of the outputs alone."""
    noise = tuple(f"noise_{name}" for name in outputs)
    return (GUST, *noise, *PROCESS) if gusts else noise


def factor_names(terms: Collection[str]) -> tuple[str, ...]:
    """Names of the factors of nonlinear terms, which follow the derivatives among the parameters."""
    return tuple(
        f"{LATERAL.derivatives[LATERAL.at(c.name, LATERAL.signals[j].name)].name}_{name}"
        for c in LATERAL.coefficients
        for name, j in nonlinear_columns(terms)
    )


def predictor_of(
    scale: LateralScale,
    outputs: tuple[str, ...],
    length_m: float,
    *,
    gusts: bool,
    measured: bool,
    terms: Collection[str] = (),
) -> Predictor:
    """The predictor at a flight condition.

    Parameters
    ----------
    scale : factors (runs,).
    outputs : those of the log, of `OUTPUTS`.
    length_m : scale length of the gust [m].
    gusts : with the gust and the noise of the moments; without, it is output error.
    measured : with the inputs `SURPLUS`.
    terms : nonlinear terms, of `airtruth.identification.options.TERMS`.
    """
    own, state_names = structure(scale), tuple(state.name for state in LATERAL.states)
    acting = list(actions(LATERAL, own, outputs))
    made = linear_terms(LATERAL, own, outputs, acting)
    made += [Term("B", row, name, 1.0) for row, name in zip(state_names, KINEMATIC, strict=True)]
    made += [
        Term(matrices[1], row, name, factor, (parameter,))
        for matrices, row, derivative, factor in acting
        for name, parameter in _known_inputs(derivative, terms, measured=measured)
    ]
    names = levels(outputs, gusts=gusts)
    made += [Term("R", name, "", 1.0, (f"noise_{name}",) * 2) for name in outputs]
    if gusts:
        made += gust_terms(LATERAL, acting, outputs, scale.airspeed_m_s, length_m, GUST)
        made += [Term("Q", name.split("_")[1], "", 1.0, (name,) * 2) for name in PROCESS]
    return Predictor(
        states=(*state_names, *(W_SHARES if gusts else ())),
        inputs=(
            *(control.name for control in LATERAL.controls),
            *KINEMATIC,
            *(SURPLUS if measured else ()),
            *(TERM.format(name, LATERAL.signals[j].name) for name, j in nonlinear_columns(terms)),
        ),
        outputs=outputs,
        parameters=(*LATERAL.parameters, *factor_names(terms), *names),
        logarithmic=names,
        terms=tuple(made),
        start=((tuple(W_SHARES), W_START),) if gusts else (),
    )


def _known_inputs(derivative: Derivative, terms: Collection[str], *, measured: bool) -> list[tuple[str, str]]:
    """Known inputs that act as the signal of a derivative does, each with its parameter."""
    made = [(SURPLUS[derivative.column], derivative.name)] if measured else []
    signal = LATERAL.signals[derivative.column].name
    return made + [
        (TERM.format(name, signal), f"{derivative.name}_{name}")
        for name, j in nonlinear_columns(terms)
        if j == derivative.column
    ]


def kinematic_inputs(batch: Batch, constants: LateralConstants, scale: LateralScale, known: Known) -> Array:
    """Rates of the states that the linear model leaves out, (runs, samples, states): `KINEMATIC`."""
    c = constants
    (p, r), q, phi = (batch.channels[name] for name in LATERAL.gyros), known.q, known.phi
    v, alpha0, theta0 = (x[:, None] for x in (scale.airspeed_m_s, scale.alpha_rad, scale.theta_rad))
    beta = p * (np.sin(known.alpha) - np.sin(alpha0)) - r * (np.cos(known.alpha) - np.cos(alpha0))
    beta = beta + G0 / v * (np.cos(known.theta) * np.sin(phi) - np.cos(theta0) * phi)
    roll = c.inertia_xz_kg_m2 * p * q - (c.inertia_zz_kg_m2 - c.inertia_yy_kg_m2) * q * r
    yaw = -c.inertia_xz_kg_m2 * q * r - (c.inertia_yy_kg_m2 - c.inertia_xx_kg_m2) * p * q
    determinant = c.inertia_xx_kg_m2 * c.inertia_zz_kg_m2 - c.inertia_xz_kg_m2**2
    p_dot = (c.inertia_zz_kg_m2 * roll + c.inertia_xz_kg_m2 * yaw) / determinant
    r_dot = (c.inertia_xz_kg_m2 * roll + c.inertia_xx_kg_m2 * yaw) / determinant
    phi_dot = (q * np.sin(phi) + r * np.cos(phi)) * np.tan(known.theta) - r * np.tan(theta0)
    return np.stack([beta, p_dot, r_dot, phi_dot], axis=2)


def _signals(batch: Batch, known: Known) -> Array:
    """Channels of the signals, (runs, signals, samples); the sideslip measured or reconstructed."""
    columns = {**batch.channels, LATERAL.vane: known.beta}
    return np.stack([columns[name] for name in REGRESSORS], axis=1)


def surplus_inputs(batch: Batch, scale: LateralScale, known: Known, options: Options) -> Array:
    """Signals about their means times the surplus of the dynamic pressure, (runs, samples, signals): `SURPLUS`."""
    c = batch.channels
    sos = butterworth(options.cutoff_of(batch.dt_s), options.order, batch.dt_s)
    v = zero_phase(c["airspeed_m_s"], sos) / scale.airspeed_m_s[:, None]
    density = air_density(c)
    pressure = v**2 * density / density.mean(axis=1, keepdims=True)
    made = []
    for signal, x in zip(LATERAL.signals, np.swapaxes(_signals(batch, known), 0, 1), strict=True):
        factor = pressure - 1.0 if signal.length is None else pressure / v - 1.0
        made.append(factor * (x - x.mean(axis=1, keepdims=True)))
    return np.stack(made, axis=2)


def term_inputs(batch: Batch, known: Known, terms: Collection[str], attack: Array) -> Array:
    """Nonlinear terms (runs, samples, terms) of the signals about their first samples, at an angle of attack (runs,) [rad]."""
    signals = _signals(batch, known)
    made = nonlinear(signals - signals[..., :1], change_of_attack(batch, attack), terms)
    return np.swapaxes(made, 1, 2)


def records_of(
    batch: Batch,
    constants: LateralConstants,
    options: Options,
    length_m: float,
    *,
    gusts: bool,
    attack: float | None = None,
) -> Records[LateralScale]:
    """Signals and predictor of a batch, one entry of `records_by_terms`."""
    choices = [options.terms]
    (made,) = records_by_terms(batch, constants, options, length_m, choices, gusts=gusts, attack=attack)
    return made


def records_by_terms(
    batch: Batch,
    constants: LateralConstants,
    options: Options,
    length_m: float,
    choices: Sequence[Collection[str]],
    *,
    gusts: bool,
    attack: float | None = None,
) -> list[Records[LateralScale]]:
    """Signals and predictors of a batch; nothing is checked. Outputs are the channels that the log has.

    Surfaces between samples have the area of the cubic through the four nearest samples, and the corners of a first-order
    servo behind a held command where the record shows one (`airtruth.numerics.intersample`).

    Parameters
    ----------
    length_m : scale length of the gust [m]; gusts : as in `predictor_of`.
    choices : nonlinear terms of each entry of the result; those of the options have no effect.
    attack : angle of attack at which the derivatives hold [rad], where terms make them depend on it; None for the steady one of
        each run.
    """
    at = steady_flight(batch, options).attack
    at = at if attack is None else np.full_like(at, attack)
    known = known_inputs(batch)
    scale = condition_of(batch, constants, options, known)
    outputs = outputs_of(batch)
    channels = {output.name: output.channel for output in LATERAL.outputs}
    y = np.stack([batch.channels[channels[name]] for name in outputs], axis=2)
    surfaces = np.stack([batch.channels[name] for name in CONTROLS], axis=2)
    u = [surfaces - surfaces[:, :1], kinematic_inputs(batch, constants, scale, known)]
    measured = options.pressure != "constant" and options.airspeed_m_s is None
    if measured:
        u.append(surplus_inputs(batch, scale, known, options))
    corners = [servo_bend(batch.channels[name]) for name in CONTROLS]
    least = floor_terms(outputs, y)
    y = y - y[:, :1]
    made = []
    for terms in choices:
        inputs = np.concatenate([*u, term_inputs(batch, known, terms, at)], axis=2)
        bend = smooth_bend(inputs, 1)
        for number, corner in enumerate(corners):
            bend[:, :, number] += corner
        own = predictor_of(scale, outputs, length_m, gusts=gusts, measured=measured, terms=terms)
        signals = KalmanSignals(y, inputs, np.ascontiguousarray(bend))
        made.append(Records(batch.dt_s, signals, layout(extended(own, least), y.shape[0]), scale))
    return made


def outputs_of(batch: Batch) -> tuple[str, ...]:
    """Outputs that the log has: without a vane, beta is a state alone."""
    return tuple(output.name for output in LATERAL.outputs if output.channel in batch.channels)


__all__ = [
    "GUST",
    "OUTPUTS",
    "PROCESS",
    "factor_names",
    "levels",
    "outputs_of",
    "predictor_of",
    "records_by_terms",
    "records_of",
]
