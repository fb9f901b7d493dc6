"""Efficiency and coverage of the estimators on records of the linear short period in gusts.

Records of 5 s at 50 Hz, 2 deg doublet, GTM figures and sensors, u and w gusts at twice the GTM's light level,
airspeed measured with 0.06 kt. Three experiments:

    linear     the dynamic pressure is constant, the u gust acts on the trim lift alone; the airspeed is not used
    measured   the pressure follows the gust in every term, and the measured airspeed is used
    constant   the same records, and a constant pressure in the regressors

Efficiency is 100 (bound/RMSE)^2 with the Cramer-Rao bound of `airtruth.identification.likelihood.cramer_rao` (gust and noise
levels unknown within 20 %), with airspeed where it is used; its lower end is that
of a two-sided 95 % interval. Prints the tables of docs/methods.md.

    python -m studies.efficiency_study [--runs N] [--gust G] [--start rest|stationary] [METHOD ...]
"""

from __future__ import annotations

import argparse
import functools
import time

import numpy as np
from numpy.typing import NDArray

from airtruth.identification import METHODS, Options, identify_batch, quantities
from airtruth.identification.likelihood.cramer_rao import experiment_bound
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL
from validation.linear_flight import AIRSPEED_M_S, GTM, LIGHT, NOISE, THETA, doublet, fly

Array = NDArray[np.float64]

AIRSPEED_STD_M_S = 0.0309  # 0.06 kt
BLOCK = 250
SEED = 41
LEVEL_PRIOR = 0.2
EXPERIMENTS = ("linear", "measured", "constant")
DEFAULT = ("ls", "iv-lowpass", "iv-f1", "frequency", "iv-refined")


def flown(runs: int, gust: float, start: str, acting: bool) -> list[Batch]:
    """Records in blocks; "stationary" ones begin after 50 s in the air."""
    more = {}
    if start == "stationary":
        more = {"duration_s": 55.0, "first_s": 50.0, "shape": functools.partial(doublet, start_s=51.0)}
    return [
        fly(
            runs=min(BLOCK, runs - first),
            gust=gust,
            noise=1.0,
            seed=SEED + first,
            acting=acting,
            airspeed_std_m_s=AIRSPEED_STD_M_S if acting else None,
            **more,
        )
        for first in range(0, runs, BLOCK)
    ]


def bound(gust: float, start: str, airspeed: bool) -> Array:
    """Smallest standard deviations (6,) of one record."""
    levels = (*NOISE[:3], LIGHT[0] * gust, LIGHT[1] * gust, LIGHT[2], LIGHT[3])
    more = {"airspeed_std_m_s": AIRSPEED_STD_M_S, "airspeed_m_s": AIRSPEED_M_S} if airspeed else {}
    options = FilterOptions(*levels, level_prior=LEVEL_PRIOR, **more)
    return np.sqrt(np.diag(experiment_bound(fly(), GTM, THETA, options, start)[0]))


def line(title: str, values: Array, form: str = "9.1f") -> None:
    print(title.ljust(22) + "".join(format(v, form) for v in values))


def report(name: str, batches: list[Batch], pressure: str, least: Array) -> None:
    """One method on one set of records."""
    options = Options(pressure=pressure)
    identify_batch(batches[0], GTM, name, options)  # compiles
    begun = time.process_time()
    every = [identify_batch(batch, GTM, name, options) for batch in batches]
    spent = time.process_time() - begun
    good = np.concatenate([e.converged for e in every])
    error = (np.concatenate([e.theta for e in every]) - THETA)[good]
    answers = [quantities(e) for e in every]
    lower, upper = (
        np.concatenate([getattr(q, side) for q in answers])[good, :6] for side in ("lower", "upper")
    )
    inside = (lower < THETA) & (upper > THETA)
    square = (error**2).mean(axis=0)
    share = (error**2).std(axis=0) / square / np.sqrt(len(error))  # standard error of the mean square
    efficiency = 100.0 * least**2 / square
    print(
        f"{name}: {(~good).sum()} of {good.size} not converged, {1e3 * spent / good.size:.2f} ms per record"
    )
    line("  standard deviation", error.std(axis=0), "9.4f")
    line("  mean error", error.mean(axis=0), "9.4f")
    line("  efficiency %", efficiency)
    line("    its lower end", efficiency / (1.0 + 1.96 * share))
    line("  coverage of 95 %", 100.0 * inside.mean(axis=0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("methods", nargs="*", metavar="METHOD", help=f"default: {' '.join(DEFAULT)}")
    parser.add_argument("--runs", type=int, default=3000)
    parser.add_argument("--gust", type=float, default=2.0, help="multiple of the light level")
    parser.add_argument("--start", choices=("rest", "stationary"), default="rest")
    parser.add_argument("--experiment", choices=EXPERIMENTS, action="append")
    chosen = parser.parse_args()
    methods = chosen.methods or DEFAULT
    unknown = sorted(set(methods) - set(METHODS))
    if unknown:
        parser.error(f"no method {', '.join(unknown)}; there are {', '.join(METHODS)}")
    for experiment in chosen.experiment or EXPERIMENTS:
        acting = experiment != "linear"
        batches = flown(chosen.runs, chosen.gust, chosen.start, acting)
        least = bound(chosen.gust, chosen.start, experiment == "measured")
        print(f"\n{experiment}: {chosen.runs} records, {chosen.gust:g} x light, gusts {chosen.start}")
        print(" " * 22 + "".join(f"{n:>9s}" for n in LONGITUDINAL.parameters))
        line("bound", least, "9.4f")
        for name in methods:
            report(name, batches, "measured" if experiment == "measured" else "constant", least)


if __name__ == "__main__":
    main()
