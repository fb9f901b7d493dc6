"""Why lateral estimates err on the GTM: experiments that switch each cause off and on, on flights of an independent plant.

The plant (`validation.affine_lateral`) flies with NASA's tables (`validation.lateral_tables`) and with the angles of attack and
pitch rates of JSBSim's flights of data/campaigns/lateral.toml: surfaces at 3 deg, light gusts, the GTM's sensors. One part of it
after another is made linear or left out. Then the estimators change: difference scheme, dynamic pressure, trim, order of the
dynamic filter, nonlinear terms. The tables show the bias of the derivatives [% of the truth], its standard error over the runs in
brackets, and the coverage of nominal 95 % intervals.

    python -m studies.lateral_causes [--runs N]
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete, lfilter

from airtruth.identification import Options, identify_batch
from airtruth.identification.lateral.observation import LateralObservation, observe
from airtruth.identification.lateral.problems import instruments, rate_of, with_corners
from airtruth.identification.lateral.solve import solution
from airtruth.logs.flight_log import batches
from airtruth.logs.sources import log_files
from airtruth.logs.store import read_log
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.lateral import lateral_system
from airtruth.physics.motion import LATERAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.table import Table, as_markdown, flat
from validation.affine_lateral import ALPHA, GTM, NAMES, PICK, RATE, fly
from validation.lateral_tables import PARTS, coefficients, slopes

CAMPAIGN = Path(__file__).resolve().parents[1] / "data" / "campaigns" / "lateral.toml"
SHOWN = ("CYbeta", "CYdr", "Clbeta", "Clp", "Clr", "Clda", "Cldr", "Cnbeta", "Cnp", "Cnr", "Cndr")
"""Derivatives in the tables; a record determines CYr to 11 % and the other three not at all."""
SECONDS = 10.0
SEED = 631
TRUTH = slopes(np.rad2deg(ALPHA))
METHODS = ("ls", "filter-error")
Estimate = tuple[np.ndarray, np.ndarray | None]
"""Derivatives (runs, 15) and their standard deviations; None where an estimator states none."""


def paths(runs: int) -> tuple[np.ndarray, np.ndarray]:
    """(runs, samples at 200 Hz) alpha about its mean [rad] and pitch rate [rad/s] of JSBSim's flights, at most 5 Hz."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "flown"
        campaign.fly(plan.make(CAMPAIGN, runs=runs), out)
        own = [batch for file in log_files(out) for batch in batches(read_log(file))]
    samples = round(SECONDS * RATE) + 1
    made = []
    for name in ("alpha_rad", "q_rad_s"):
        rows = np.concatenate([batch.channels[name] for batch in own])
        smooth = zero_phase(rows, butterworth(5.0, 4, PICK / RATE))
        smooth -= smooth.mean(axis=1, keepdims=True) if name == "alpha_rad" else 0.0
        at, grid = np.arange(samples) / RATE, np.arange(rows.shape[1]) * PICK / RATE
        made.append(np.stack([np.interp(at, grid, row) for row in smooth]))
    return made[0], made[1]


def flown(
    alpha: np.ndarray, q: np.ndarray, linear: Collection[str] = (), degrees: float = 3.0, gust: float = 1.0
):
    """Records of the plant; without "alpha" among the linear parts the tables see the change of the angle of attack."""
    still = "alpha" in linear

    def aerodynamics(signals: np.ndarray, attack: np.ndarray) -> np.ndarray:
        return coefficients(np.rad2deg(ALPHA + (0.0 * attack if still else attack)), signals, linear)

    return fly(len(alpha), SECONDS, degrees, gust, seed=SEED, q=q, alpha=alpha, aerodynamics=aerodynamics)


def by_method(name: str, options: Options | None = None) -> Callable[..., Estimate]:
    """An estimator of the package."""

    def estimate(batch) -> Estimate:
        made = identify_batch(batch, GTM, name, options or Options(), LATERAL)
        return made.theta, np.sqrt(np.diagonal(made.covariance, axis1=1, axis2=2))

    return estimate


def without_q(name: str) -> Callable[..., Estimate]:
    """The same from records without the pitch rate: products of the rates are left out."""

    def estimate(batch) -> Estimate:
        channels = {n: x for n, x in batch.channels.items() if n != "q_rad_s"}
        return by_method(name)(type(batch)(batch.run_ids, batch.dt_s, batch.t_s, channels))

    return estimate


def _solved(z: np.ndarray, x: np.ndarray, y: np.ndarray, free: np.ndarray) -> np.ndarray:
    """theta (runs, 15) of rows whose components along the free rows are taken out."""
    basis = np.swapaxes(np.linalg.qr(np.swapaxes(free, 1, 2))[0], 1, 2)
    z, x, y = (rows - rows @ np.swapaxes(basis, 1, 2) @ basis for rows in (z, x, y))
    return solution(z @ np.swapaxes(x, 1, 2), z @ np.swapaxes(y, 1, 2))


def central(batch) -> Estimate:
    """Least squares with central differences in place of those of fourth order."""
    o = observe(batch, GTM, Options())
    sos = butterworth(5.0, 4, o.dt_s)
    x = zero_phase(with_corners(o), sos)
    y = np.gradient(zero_phase(o.slopes, sos), o.dt_s, axis=-1) + zero_phase(o.added, sos)
    free = np.ones_like(x[:, :1])
    return _solved(x, x, y, free), None


def fourth(batch) -> Estimate:
    """Least squares as `central`, with differences of fourth order: the reference of that experiment."""
    o = observe(batch, GTM, Options())
    sos = butterworth(5.0, 4, o.dt_s)
    inside = slice(2, -2)
    x = zero_phase(with_corners(o), sos)[..., inside]
    y = rate_of(zero_phase(o.slopes, sos), o.dt_s) + zero_phase(o.added, sos)[..., inside]
    return _solved(x, x, y, np.ones_like(x[:, :1])), None


def dynamic(order: int) -> Callable[..., Estimate]:
    """IV(f1) with the denominator of beta, p, r (order 3), or with that of beta, p, r, phi, which contains the spiral (4)."""

    def estimate(batch) -> Estimate:
        o = observe(batch, GTM, Options())
        theta, _ = fourth(batch)
        for _ in range(10):
            theta = np.concatenate([_filtered(o, theta, run, order) for run in range(len(theta))])
        return theta, None

    return estimate


def _filtered(o: LateralObservation, theta: np.ndarray, run: int, order: int) -> np.ndarray:
    """One iteration for a run: theta (1, 15)."""
    one = np.array([run])
    scale = type(o.scale)(*(getattr(o.scale, name)[one] for name in o.scale.__dataclass_fields__))
    matrix = lateral_system(theta[one], scale).a[0, :order, :order]
    denominator = np.poly(matrix)
    with np.errstate(all="ignore"):
        try:
            filters = [
                cont2discrete(([*gain], denominator), o.dt_s, method="foh")[:2]
                for gain in ((1.0,), (1.0, 0.0))
            ]
            z = instruments(o, theta, one, o.controls[one], o.bend[one])
            value, slope = (lambda rows, b=b, a=a: lfilter(np.ravel(b), a, rows, axis=-1) for b, a in filters)
            x = value(with_corners(o)[one])
            y = slope(o.slopes[one]) + value(o.added[one])
            free = value(np.ones_like(x[:, :1]))
            return _solved(value(z), x, y, free)
        except (np.linalg.LinAlgError, ValueError):
            return np.full((1, 15), np.nan)


def row(label: str, estimate: Callable[..., Estimate], batch) -> tuple[str, ...]:
    """Bias with its standard error, and the coverage; medians where an estimator diverges in some runs."""
    theta, std = estimate(batch)
    error = 100.0 * (theta - TRUTH) / np.abs(TRUTH)
    kept = np.isfinite(error).all(axis=1) & (np.abs(error[:, [NAMES.index(n) for n in SHOWN]]) < 1e3).all(
        axis=1
    )
    lost = len(error) - int(kept.sum())
    cells = []
    for name in SHOWN:
        own = error[kept, NAMES.index(name)]
        cells.append(f"{own.mean():.1f} ({own.std(ddof=1) / np.sqrt(len(own)):.1f})")
    spread = np.sqrt(np.mean(error[kept][:, [NAMES.index(n) for n in SHOWN]] ** 2, axis=0))
    covered = (
        "-" if std is None else f"{100.0 * (np.abs(theta - TRUTH)[kept] <= 1.96 * std[kept]).mean():.0f}"
    )
    return (label, *cells, f"{np.exp(np.log(spread).mean()):.2f}", covered, str(lost))


COLUMNS = ("experiment", *SHOWN, "RMSE, geometric mean [%]", "coverage [%]", "runs lost")


def of_the_plant(alpha: np.ndarray, q: np.ndarray) -> list[Table]:
    """One part of the plant made linear at a time, for each method."""
    zero = np.zeros_like(alpha)
    plants = {
        "all of NASA's tables": flown(alpha, q),
        "linear in sideslip": flown(alpha, q, ("sideslip",)),
        "linear in the aileron": flown(alpha, q, ("aileron",)),
        "linear in the rudder": flown(alpha, q, ("rudder",)),
        "linear in the rates": flown(alpha, q, ("rates",)),
        "tables at the trim's alpha": flown(alpha, q, ("alpha",)),
        "no moments at rest": flown(alpha, q, ("trim",)),
        "no pitching": flown(alpha, zero),
        "no pitching, constant alpha": flown(zero, zero),
        "affine": flown(alpha, q, PARTS),
        "affine in sideslip and alpha alone": flown(alpha, q, ("sideslip", "alpha")),
        "all tables, 6 deg": flown(alpha, q, degrees=6.0),
        "linear in the aileron, 6 deg": flown(alpha, q, ("aileron",), degrees=6.0),
    }
    return [
        flat(f"Plant, {method}", COLUMNS, [row(label, by_method(method), b) for label, b in plants.items()])
        for method in METHODS
    ]


def of_the_estimator(alpha: np.ndarray, q: np.ndarray) -> Table:
    """Choices of the estimator: on the affine plant, where only they can err, and on all tables."""
    affine, tables = flown(alpha, q, PARTS), flown(alpha, q)
    constant = Options(pressure="constant")
    rows = [
        row("affine: ls, differences of fourth order", fourth, affine),
        row("affine: ls, central differences", central, affine),
        row("affine: ls, measured pressure", by_method("ls"), affine),
        row("affine: ls, constant pressure", by_method("ls", constant), affine),
        row("affine: filter-error, measured pressure", by_method("filter-error"), affine),
        row("affine: filter-error, constant pressure", by_method("filter-error", constant), affine),
        row("affine: ls, without q", without_q("ls"), affine),
        row("affine: ls, trim by a mean", by_method("ls", Options(trim="mean")), affine),
        row("affine: f1 without the spiral (order 3)", dynamic(3), affine),
        row("affine: f1 with the spiral (order 4)", dynamic(4), affine),
        row("affine: iv-f1 of the package", by_method("iv-f1"), affine),
        row("affine: output-error", by_method("output-error"), affine),
    ]
    for method in METHODS:
        for terms in ((), ("beta",), ("alpha",), ("alpha", "beta")):
            words = " and ".join(terms) or "none"
            rows.append(
                row(f"tables: {method}, terms {words}", by_method(method, Options(terms=terms)), tables)
            )
    return flat("Estimator", COLUMNS, rows)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=40)
    asked = parser.parse_args()
    alpha, q = paths(asked.runs)
    print(f"{asked.runs} runs of {SECONDS:g} s; bias [% of the truth] (standard error)\n")
    for table in (of_the_estimator(alpha, q), *of_the_plant(alpha, q)):
        print(as_markdown(table))


if __name__ == "__main__":
    main()
