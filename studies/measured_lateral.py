"""Lateral estimates of measured flights beside their published results.

The records are not part of the project: ``--folder`` or AIRTRUTH_MEASURED names the folder that holds them. A record that is
absent is left out.

    python -m studies.measured_lateral [--folder DIR]

- NASA's Twin Otter, record 017 (V. Klein and E. A. Morelli, *Aircraft System Identification*, 2nd ed., 2016): equation error
  with the accelerations of the file and with differences of the rates, and output error.
- ATTAS (R. V. Jategaonkar, *Flight Vehicle System Identification*, 2nd ed., AIAA, 2015, ch. 4): output error of two states,
  p and r, with the sideslip as an input.
- DHC-2 (ch. 5), simulated in turbulence: filter error and output error of two states. The outputs of the file are linear in its
  p, r and inputs to all digits, which gives the derivatives of the simulation; white noise is added to them here.
"""

from __future__ import annotations

import argparse
import itertools
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identification import Options, identify_batch
from airtruth.identification.estimates import Status
from airtruth.identification.lateral.observation import observe
from airtruth.identification.lateral.problems import ls_problem, smoothed
from airtruth.identification.likelihood.fit import Records, joint_maximum
from airtruth.identification.likelihood.kalman import score
from airtruth.identification.likelihood.kalman_kernel import Signals
from airtruth.identification.likelihood.predictor import Predictor, Term, layout
from airtruth.identification.likelihood.scoring import Search
from airtruth.importers.sources import open_source
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LATERAL
from airtruth.table import Table, as_markdown, flat
from airtruth.units import DEG, FT, G0, PSF, SLUG

Array = NDArray[np.float64]

FOLDER: Final = Path(
    os.environ.get("AIRTRUTH_MEASURED", Path(__file__).resolve().parents[2] / "shared" / "measured")
)
"""Folder of the records."""
TWIN_OTTER, ATTAS, DHC2 = "totter_lat_f1_017.mat", "fAttasAilRud1.mat", "y13aus_da1.asc"
EQUATION_ERROR: Final = {
    "Cl": (-0.1051, -0.528, 0.193, -0.2117, 0.0299),
    "Cn": (0.0854, -0.0515, -0.198, 0.0023, -0.1305),
}
"""Published equation error of the Twin Otter by beta, phat, rhat, aileron, rudder."""
OUTPUT_ERROR: Final = {
    "Cl": (-0.1196, -0.586, 0.189, -0.228, 0.042),
    "Cn": (0.0864, -0.064, -0.191, -0.003, -0.1355),
}
"""Published output error of the Twin Otter."""
RATES: Final = ("p", "r")
SURFACES: Final = ("da", "dr")
ATTAS_PUBLISHED: Final = {
    "Lp": -2.0675, "Lr": 1.0293, "Lda": -6.3059, "Ldr": 1.1452, "Lbeta": -3.8444,
    "Np": -0.1839, "Nr": -0.4856, "Nda": -0.3912, "Ndr": -1.7609, "Nbeta": 3.0314,
}  # fmt: skip
"""Published output error of the ATTAS [rad, s], from two records of a minute each."""
ATTAS_ARM_M: Final = 13.08
"""The sideslip is measured ahead of the CG by this distance [m]."""
MEMORY_S: Final = 5.0
"""Largest lag of the correlation of residuals [s]; judgement: a period of the Dutch roll."""
NOISE: Final = 0.05
"""Noise that is added to the outputs of the DHC-2, over their spread [-]."""
SEED: Final = 5


@dataclass(frozen=True)
class TwinOtter:
    """Record 017.

    Attributes
    ----------
    batch, aircraft : its channels, and geometry and mass of the file.
    p_dot, r_dot : (1, samples) angular accelerations of the file [rad/s2].
    """

    batch: Batch
    aircraft: Any
    p_dot: Array
    r_dot: Array


@dataclass(frozen=True)
class Fit:
    """Derivatives of a model of two states.

    Attributes
    ----------
    value, std : by name [rad, s]; std from white residuals.
    coloured : std from the correlation of the residuals, by name.
    residual : standard deviation of the residuals by output.
    converged : whether the search found a maximum.
    """

    value: dict[str, float]
    std: dict[str, float]
    coloured: dict[str, float]
    residual: dict[str, float]
    converged: bool


def twin_otter(path: Path) -> TwinOtter:
    """Read the record; its columns are numbered as those of SIDPAC, from 1."""
    data = open_source(path).arrays["fdata"]

    def column(number: int, unit: float = 1.0) -> Array:
        return np.ascontiguousarray(data[:, number - 1] * unit)[None]

    unit = SLUG * FT**2
    aircraft = SimpleNamespace(
        wing_area_m2=data[0, 76] * FT**2,
        span_m=data[0, 77] * FT,
        chord_m=data[0, 78] * FT,
        mass_kg=data[0, 47] * SLUG,
        inertia_xx_kg_m2=data[0, 48] * unit,
        inertia_yy_kg_m2=data[0, 49] * unit,
        inertia_zz_kg_m2=data[0, 50] * unit,
        inertia_xz_kg_m2=data[0, 51] * unit,
    )
    speed = column(2, FT)
    channels = {
        "airspeed_m_s": speed,
        "density_kg_m3": 2.0 * column(27, PSF) / speed**2,
        "ay_m_s2": column(12, G0),
    }
    degrees = ("beta", "alpha", "p", "q", "r", "phi", "theta")
    for number, name in enumerate(degrees, start=3):
        channels[f"{name}_rad_s" if name in "pqr" else f"{name}_rad"] = column(number, DEG)
    channels |= {"aileron_rad": column(15, DEG), "rudder_rad": column(16, DEG)}
    batch = Batch(("017",), 0.02, column(1), channels)
    return TwinOtter(batch, aircraft, column(42, DEG), column(44, DEG))


def with_the_files_accelerations(record: TwinOtter) -> Array:
    """(3, 5) least squares of CY, Cl, Cn with p' and r' of the file, which are not filtered here."""
    batch, c = record.batch, record.aircraft
    p, q, r = (batch.channels[f"{name}_rad_s"] for name in "pqr")
    pressure = 0.5 * batch.channels["density_kg_m3"] * batch.channels["airspeed_m_s"] ** 2
    force = pressure * c.wing_area_m2 * c.span_m
    ixx, iyy, izz, ixz = (getattr(c, f"inertia_{n}_kg_m2") for n in ("xx", "yy", "zz", "xz"))
    roll = (ixx * record.p_dot - ixz * (record.r_dot + p * q) + (izz - iyy) * q * r) / force
    yaw = (izz * record.r_dot - ixz * (record.p_dot - q * r) + (iyy - ixx) * p * q) / force
    options = Options(cutoff_hz=24.9)  # half the sample rate: neither side is low-passed
    o = observe(batch, c, options)
    own = replace(
        o,
        slopes=np.zeros_like(o.slopes),
        added=np.stack([o.added[:, 0], roll, yaw], axis=1),
        bend=np.zeros_like(o.bend),
    )
    rows = ls_problem(own, options, smoothed(own, options)).rows(np.empty((1, 15)), np.arange(1))
    theta: Array = np.linalg.lstsq(rows.x[0].T, rows.y[0].T, rcond=None)[0].T
    return theta


def gain_of_the_files_p_dot(record: TwinOtter, low_hz: float, high_hz: float) -> float:
    """Amplitude of the file's p' over that of the differences of p in a band [-]."""
    dt = record.batch.dt_s
    window = np.hanning(record.p_dot.size)
    hz = np.fft.rfftfreq(record.p_dot.size, dt)
    band = (hz > low_hz) & (hz < high_hz)
    rows = (record.p_dot[0], np.gradient(record.batch.channels["p_rad_s"][0], dt))
    power = [(np.abs(np.fft.rfft(window * x))[band] ** 2).sum() for x in rows]
    return float(np.sqrt(power[0] / power[1]))


def twin_otter_table(record: TwinOtter) -> Table:
    """Published and own estimates of Cl and Cn."""

    def of_method(name: str) -> Array:
        return identify_batch(record.batch, record.aircraft, name, motion=LATERAL).theta[0].reshape(3, 5)

    file = with_the_files_accelerations(record)
    own, output, innovations = (of_method(name) for name in ("ls", "output-error", "filter-error"))
    rows = []
    for k, coefficient in ((1, "Cl"), (2, "Cn")):
        for j, signal in enumerate(LATERAL.signals):
            name = LATERAL.derivatives[LATERAL.at(coefficient, signal.name)].name
            published = EQUATION_ERROR[coefficient][j]
            values = (published, file[k, j], own[k, j], OUTPUT_ERROR[coefficient][j], output[k, j])
            rows.append((name, *(f"{x:.4f}" for x in (*values, innovations[k, j]))))
    gains = [f"{gain_of_the_files_p_dot(record, *band):.3f}" for band in ((0.1, 0.6), (1.5, 2.0), (2.0, 3.0))]
    return flat(
        f"Twin Otter 017; amplitude of the file's p' over that of differences of p: {gains[0]} below .6 Hz, {gains[1]} from 1.5 "
        f"to 2 Hz, {gains[2]} from 2 to 3 Hz",
        (
            "derivative",
            "equation error, published",
            "least squares, p' and r' of the file",
            "`ls`",
            "output error, published",
            "`output-error`",
            "`filter-error`",
        ),
        rows,
    )


def model_of_rates(air: str, *, rates_alone: bool, turbulence: bool) -> Predictor:
    """p' and r' by p, r, aileron, rudder and the measured motion of the air, an input.

    Parameters
    ----------
    air : name of that input: "beta" [rad] or "v" [m/s].
    rates_alone : outputs p and r; otherwise p', r', ay, p and r.
    turbulence : white noise of p' and r'.
    """
    inputs = (*SURFACES, air)
    outputs = RATES if rates_alone else ("p_dot", "r_dot", "ay", *RATES)
    terms, names = [], []
    for letter, state in zip("LNY", (*RATES, ""), strict=True):
        if not state and rates_alone:
            continue
        for signal in (*RATES, *inputs):
            names.append(letter + signal)
            kinds = ("A", "C") if signal in RATES else ("B", "D")
            if state:
                terms.append(Term(kinds[0], state, signal, 1.0, (names[-1],)))
            if not rates_alone:
                terms.append(Term(kinds[1], f"{state}_dot" if state else "ay", signal, 1.0, (names[-1],)))
    terms += [Term("C", name, name, 1.0) for name in RATES]
    levels = tuple(f"noise_{name}" for name in outputs)
    terms += [Term("R", name, "", 1.0, (f"noise_{name}",) * 2) for name in outputs]
    if turbulence:
        drives = tuple(f"turbulence_{name}" for name in RATES)
        terms += [Term("Q", name, "", 1.0, (f"turbulence_{name}",) * 2) for name in RATES]
        levels = (*levels, *drives)
    return Predictor(RATES, inputs, outputs, (*names, *levels), levels, tuple(terms))


def fitted(model: Predictor, y: Array, u: Array, dt_s: float, ends: Sequence[int]) -> Fit:
    """Maximum of the likelihood; each segment has initial states and biases of its own, inputs are linear between samples.

    Parameters
    ----------
    model : of `model_of_rates`.
    y, u : (samples, outputs), (samples, inputs).
    ends : rows at which the segments begin, and the last end.
    """
    records = []
    for a, b in itertools.pairwise(ends):
        own_u = u[None, a:b] - u[a]
        signals = Signals(y[None, a:b] - y[a], own_u, np.zeros_like(own_u))
        records.append(Records(dt_s, signals, layout(model, 1), SimpleNamespace()))
    count = len(model.parameters) - len(model.logarithmic)
    own = model.parameters[:count]
    declared = np.log([*(0.3 * y.std(axis=0)), *(0.1,) * (len(model.logarithmic) - y.shape[1])])
    free = np.arange(len(model.parameters))
    search = Search(
        declared=np.concatenate([np.zeros(count), declared])[None],
        free=free,
        weight=np.where(free < count, 0.0, 0.04),  # a factor of e^5 of a level is one deviation of its prior
        level=slice(count, len(free)),
        tolerance=1e-3,
        maximum_iterations=200,
        to_prior=True,
    )
    made = joint_maximum(records, by_least_squares(model, y, u, dt_s), search)
    z, std = made.z[0], np.sqrt(np.diagonal(made.covariance[0]))
    noise = zip(model.logarithmic, np.exp(z[count:]), strict=True)
    return Fit(
        dict(zip(own, z, strict=False)),
        dict(zip(own, std, strict=False)),
        dict(zip(own, np.sqrt(np.diagonal(coloured(records, z, std, count))), strict=True)),
        {name.removeprefix("noise_"): x for name, x in noise},
        bool(made.status[0] == Status.CONVERGED),
    )


def by_least_squares(model: Predictor, y: Array, u: Array, dt_s: float) -> Array:
    """Start of a search, (derivatives,): least squares of p', r' and ay where it is an output."""
    signals = dict(zip((*model.outputs, *model.inputs), np.hstack([y, u]).T, strict=True))
    x = np.column_stack([*(signals[n] for n in (*RATES, *model.inputs)), np.ones(len(y))])
    sides = [signals.get(f"{n}_dot", np.gradient(signals[n], dt_s)) for n in RATES]
    sides += [signals["ay"]] if "ay" in signals else []
    return np.concatenate([np.linalg.lstsq(x, side, rcond=None)[0][:-1] for side in sides])


def coloured(records: Sequence[Records[Any]], z: Array, std: Array, count: int) -> Array:
    """(count, count) covariance of derivatives by the correlation of the innovations.

    Source: E. A. Morelli and V. Klein, J. Aircraft 34 (1997) 102-108, eq (24), with the lags weighed from 1 to 0 (Bartlett).
    """
    information, spread = np.zeros((count, count)), np.zeros((count, count))
    none = np.empty(0, dtype=np.int64)

    def innovations(record: Records[Any], at: Array) -> Array:
        one = np.zeros(1, dtype=np.int64)
        return score(record.layout, one, at[None], none, record.signals, record.dt_s).innovations[0]

    for record in records:
        slopes = []
        for i in range(count):
            step = np.zeros_like(z)
            step[i] = 0.1 * std[i]
            ahead, behind = (innovations(record, z + side * step) for side in (1.0, -1.0))
            slopes.append((ahead - behind) / (2.0 * step[i]))
        e, x = innovations(record, z), np.stack(slopes)  # (samples, outputs), (count, samples, outputs)
        lags = round(MEMORY_S / record.dt_s)
        for output in range(e.shape[1]):
            own, residual = x[:, :, output], e[:, output]
            information += own @ own.T
            for lag in range(lags):
                weight = (
                    (1.0 - lag / lags) * (residual[lag:] @ residual[: len(residual) - lag]) / len(residual)
                )
                product = weight * own[:, lag:] @ own[:, : len(residual) - lag].T
                spread += product if lag == 0 else product + product.T
    inverse = np.linalg.inv(information)
    return inverse @ spread @ inverse


def attas(path: Path) -> tuple[Array, Array, list[int], Array]:
    """p, r [rad/s] (samples, 2); aileron, rudder, sideslip [rad] (samples, 3); row of the gap; airspeed [m/s]."""
    data = next(iter(open_source(path).arrays.values()))
    y = DEG * data[:, [6, 8]]
    u = DEG * np.column_stack([0.5 * (data[:, 28] - data[:, 27]), data[:, 29], data[:, 13]])
    gap = np.flatnonzero(np.diff(data[:, 0]) > 0.1) + 1
    return y, u, [int(k) for k in gap], data[:, 14]


def attas_fits(path: Path) -> tuple[Fit, Fit, Fit]:
    """The record as one segment, divided at its gap, and as one segment with the sideslip moved to the CG."""
    y, u, gap, airspeed = attas(path)
    model = model_of_rates("beta", rates_alone=True, turbulence=False)
    moved = np.column_stack([u[:, :2], u[:, 2] - ATTAS_ARM_M * y[:, 1] / airspeed])
    cases = ((u, [0, len(y)]), (u, [0, *gap, len(y)]), (moved, [0, len(y)]))
    whole, divided, at_cg = (fitted(model, y, inputs, 0.04, ends) for inputs, ends in cases)
    return whole, divided, at_cg


def attas_table(path: Path) -> Table:
    """Published and own derivatives of the ATTAS."""
    whole, divided, moved = attas_fits(path)
    rows = [
        (
            name,
            f"{published:.4f}",
            f"{whole.value[name]:.4f}",
            f"{100.0 * (whole.value[name] / published - 1.0):+.1f}",
            f"{100.0 * whole.std[name] / abs(published):.1f}",
            f"{100.0 * whole.coloured[name] / abs(published):.1f}",
            f"{100.0 * (divided.value[name] / published - 1.0):+.1f}",
            f"{100.0 * (moved.value[name] / published - 1.0):+.1f}",
        )
        for name, published in ATTAS_PUBLISHED.items()
    ]
    residuals = [", ".join(f"{x / DEG:.3f}" for x in fit.residual.values()) for fit in (whole, moved)]
    return flat(
        f"ATTAS; residuals of p and r {residuals[0]} deg/s, with the sideslip at the CG {residuals[1]}",
        (
            "derivative",
            "published, two records",
            "this record alone",
            "difference [%]",
            "deviation, white residuals [%]",
            "deviation, coloured residuals [%]",
            "divided at the gap: difference [%]",
            "sideslip at the CG: difference [%]",
        ),
        rows,
    )


def dhc2_fits(path: Path) -> tuple[dict[str, float], dict[str, Fit]]:
    """Derivatives of the simulation; filter error and output error with noise added to the outputs p', r', ay, p, r."""
    data = np.loadtxt(path)
    y, u = data[:, 11:16], data[:, 16:19]
    noisy = y + NOISE * y.std(axis=0) * np.random.default_rng(SEED).standard_normal(y.shape)
    models = {
        name: model_of_rates("v", rates_alone=False, turbulence=on)
        for name, on in (("filter error", True), ("output error", False))
    }
    names = models["output error"].parameters
    truth = dict(zip(names, by_least_squares(models["output error"], y, u, 0.05), strict=False))
    return truth, {name: fitted(model, noisy, u, 0.05, [0, len(u)]) for name, model in models.items()}


def dhc2_table(path: Path) -> Table:
    """Derivatives of the DHC-2 and their standard deviations."""
    truth, fits = dhc2_fits(path)
    rows = [
        (name, f"{x:.4g}", *(f"{fit.value[name]:.4g} ({fit.std[name]:.2g})" for fit in fits.values()))
        for name, x in truth.items()
    ]
    return flat(
        f"DHC-2, simulated in turbulence, with {100 * NOISE:g} % noise; standard deviation in brackets",
        ("derivative", "simulation", *(n if f.converged else f"{n}, not converged" for n, f in fits.items())),
        rows,
    )


def main() -> None:
    """Print the tables of the records that are there."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--folder", type=Path, default=FOLDER)
    folder = parser.parse_args().folder
    tables = {
        TWIN_OTTER: lambda path: twin_otter_table(twin_otter(path)),
        ATTAS: attas_table,
        DHC2: dhc2_table,
    }
    for name, table in tables.items():
        if (folder / name).is_file():
            print(as_markdown(table(folder / name)), flush=True)
        else:
            print(f"{folder / name} is absent\n", flush=True)


if __name__ == "__main__":
    main()
