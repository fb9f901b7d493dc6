"""Efficiency, coverage, failures and time of filter error; plain `python -m benchmarks.bench_filter_error`.

Records of 5 s at 50 Hz of the linear GTM in u and w gusts with its sensors, started from iv-f1 (least
squares where iv-f1 fails). Efficiency is 100 (bound/RMSE)^2, with the exact bound of the same experiment:
the elevator without its sensor noise, gusts from rest, initial states and biases (and levels, where they are
estimated) unknown. Its standard error is 100 sqrt(2/runs) points at 100 %. Times are CPU of one core, the
best of three, without the start.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable

import numpy as np

from airtruth.identification import Options, identify_batch, quantities
from airtruth.identification.likelihood.cramer_rao import experiment_bound
from airtruth.identification.likelihood.fit import FilterOptions, fit, fit_joint
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import modal
from validation.linear_flight import AIRSPEED_M_S, GTM, LIGHT, NOISE, THETA, doublet, fly, gtm_scale

PRIOR = 0.2
AIRSPEED_STD_M_S = 0.0309  # 0.06 kt


def declared(gust: float, level_prior: float | None = PRIOR, **more: float) -> FilterOptions:
    """The truth of the records."""
    levels = (*NOISE[:3], LIGHT[0] * gust, LIGHT[1] * gust, LIGHT[2], LIGHT[3])
    return FilterOptions(*levels, level_prior=level_prior, **more)


def started(batch: Batch) -> tuple[np.ndarray, int]:
    """iv-f1 with least squares where it failed, and how often it did."""
    iv, ls = (identify_batch(batch, GTM, name, Options(covariance="none")) for name in ("iv-f1", "ls"))
    return np.where(iv.converged[:, None], iv.theta, ls.theta), int((~iv.converged).sum())


def cpu_s(work: Callable[[], object], repeat: int = 3) -> float:
    """Least CPU time [s] of a few repetitions, after one to compile."""
    work()
    best = np.inf
    for _ in range(repeat):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def line(title: str, values: np.ndarray, form: str = "9.1f") -> None:
    print(title.ljust(30) + "".join(format(v, form) for v in values))


def quality(gust: float, start: str, runs: int) -> None:
    """Efficiency and coverage at one level; "stationary" records begin after 50 s in the air."""
    more = {}
    if start == "stationary":
        more = {"duration_s": 55.0, "first_s": 50.0, "shape": functools.partial(doublet, start_s=51.0)}
    batch = fly(runs=runs, gust=gust, noise=1.0, seed=41, **more)
    theta, failed = started(batch)
    truth = np.append(THETA, modal(THETA, gtm_scale()))
    print(f"\n{gust:g} x light, gusts {start}, {runs} runs; iv-f1 fails in {failed}")
    print(" " * 30 + "".join(f"{n:>9s}" for n in LONGITUDINAL.parameters))
    for name, prior in (("levels known", None), ("levels estimated", PRIOR)):
        options = declared(gust, prior)
        estimates = fit(batch, GTM, theta, options)
        good = estimates.converged
        error = estimates.theta[good] - THETA
        least = np.sqrt(np.diag(experiment_bound(fly(), GTM, THETA, options, start)[0]))
        rmse = np.sqrt((error**2).mean(axis=0))
        q = quantities(estimates)
        inside = ((q.lower < truth) & (truth < q.upper))[good]
        seconds = cpu_s(lambda o=options: fit(batch, GTM, theta, o))
        print(
            f"{name}: not converged {(~good).sum()}, steps {estimates.iterations.mean():.1f} "
            f"(most {estimates.iterations.max()}), {1e3 * seconds / runs:.2f} ms per record"
        )
        line("  bound", least, "9.4f")
        line("  RMSE", rmse, "9.4f")
        line("  efficiency %", 100.0 * (least / rmse) ** 2)
        line("  mean error, standard errors", error.mean(axis=0) / error.std(axis=0) * np.sqrt(good.sum()))
        line("  coverage of 95 %", 100.0 * inside.mean(axis=0)[:6])
        line("  coverage of wn, zeta", 100.0 * inside.mean(axis=0)[6:])


def bounds() -> None:
    """What airspeed is worth."""
    print("\nBound of one record, 2 x light, levels unknown")
    for start in ("rest", "stationary"):
        for title, options in (
            (f"{start}", declared(2.0)),
            (
                f"{start}, airspeed 0.06 kt",
                declared(2.0, airspeed_std_m_s=AIRSPEED_STD_M_S, airspeed_m_s=AIRSPEED_M_S),
            ),
        ):
            line(title, np.sqrt(np.diag(experiment_bound(fly(), GTM, THETA, options, start)[0])), "9.4f")


def scaling() -> None:
    print("\nCost of a fit, levels estimated, 2 x light: ms per record and second of record")
    for seconds in (5.0, 10.0, 20.0, 40.0):
        batch = fly(runs=20, gust=2.0, noise=1.0, seed=42, duration_s=seconds)
        theta = np.tile(THETA, (20, 1))
        spent = cpu_s(lambda b=batch, t=theta: fit(b, GTM, t, declared(2.0)))
        print(f"{seconds:6.0f} s records: {1e3 * spent / 20 / seconds:.3f}")
    print("Cost of a joint fit: ms per record")
    for runs in (10, 40, 160):
        batch = fly(runs=runs, gust=2.0, noise=1.0, seed=43)
        spent = cpu_s(lambda b=batch: fit_joint([b], GTM, THETA, declared(2.0)))
        print(f"{runs:6d} records: {1e3 * spent / runs:.2f}")


def main() -> None:
    quality(1.0, "rest", 1000)
    quality(2.0, "rest", 3000)
    quality(4.3, "rest", 1000)
    quality(2.0, "stationary", 250)  # eleven times as long to fly
    bounds()
    scaling()


if __name__ == "__main__":
    main()
