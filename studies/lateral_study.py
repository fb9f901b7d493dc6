"""The lateral estimators on records of an affine aircraft: tables as the paper's, errors over the bound, coverage.

The GTM at 75 kt EAS, 7000 ft, with affine lateral aerodynamics (`validation.affine_lateral`): aileron doublet, then rudder
3-2-1-1, 3 deg, records of 10 s at 50 Hz, the GTM's sensors, gusts u and v at LEVEL times the light ones. Each method is
printed with mean, standard deviation, RelErr = |mean - truth|/|truth| of the 15 derivatives, iterations and modal parameters;
then RMSE over the Cramer-Rao bound (gust, sensor noise and output biases unknown; no noise of p' and r') and the coverage of
nominal 95 % intervals.

    python -m studies.lateral_study [--runs N] [--level L] [--pressure measured|constant] [--seconds S] [METHOD ...]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from airtruth.identification import LATERAL_METHODS, Estimates, Options, identify_batch, quantities
from airtruth.identification.estimates import concatenated
from airtruth.identification.lateral.predictor import PROCESS, levels, outputs_of, records_of
from airtruth.identification.likelihood.cramer_rao import bound
from airtruth.physics.lateral import lateral_modal
from airtruth.physics.motion import LATERAL
from validation.affine_lateral import GTM, LIGHT, NOISE, THETA, fly

BLOCK = 100
SEED = 71


def flown(runs: int, level: float, seconds: float):
    """Records in blocks."""
    return [
        fly(min(BLOCK, runs - first), seconds, gust=level, seed=SEED + first)
        for first in range(0, runs, BLOCK)
    ]


def least_covariance(batch, constants, theta: np.ndarray, level: float) -> np.ndarray:
    """(15, 15) bound from the first run of a batch; gust, sensor noise and biases unknown, no noise of p' and r'."""
    gusts = level > 0.0
    data = records_of(batch, constants, Options(pressure="constant"), LIGHT[3], gusts=gusts)
    channels = {output.name: output.channel for output in LATERAL.outputs}
    noise = [NOISE[channels[name]] for name in outputs_of(batch)]
    known = [level * LIGHT[1], *noise, *(1e-9 for _ in PROCESS)] if gusts else noise
    count = len(theta)
    z = np.concatenate([theta, np.log(known)])
    names = levels(outputs_of(batch), gusts=gusts)
    free = np.array([*range(count), *(count + i for i, name in enumerate(names) if name not in PROCESS)])
    n = data.layout.sizes[0]
    start = np.zeros((n, n))
    if gusts:
        start[4:, 4:] = [[1.0, 0.5], [0.5, 0.5]]
    made = bound(data.layout, 0, z, free, data.signals, data.dt_s, start, np.arange(4))
    return made[:count, :count]


def deviations_of_the_bound(level: float, seconds: float):
    """(15,) least standard deviations of unbiased estimates from one record."""
    return np.sqrt(np.diag(least_covariance(fly(1, seconds, noise=0.0), GTM, THETA, level)))


def estimated(batches, method: str, options: Options) -> tuple[Estimates, float]:
    """Estimates of all records and the time of a run on one core [ms]."""
    begin = time.process_time()
    parts = [identify_batch(batch, GTM, method, options, LATERAL) for batch in batches]
    spent = time.process_time() - begin
    runs = sum(len(batch.run_ids) for batch in batches)
    ids = [f"{k}-{run}" for k, part in enumerate(parts) for run in part.run_ids]
    split = [
        ids[sum(len(p.run_ids) for p in parts[:k]) :][: len(part.run_ids)] for k, part in enumerate(parts)
    ]

    named = [replace(part, run_ids=tuple(own)) for part, own in zip(parts, split, strict=True)]
    return concatenated(named, ids), 1e3 * spent / runs


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--level", type=float, default=1.0)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--pressure", default="method", choices=("method", "measured", "constant"))
    parser.add_argument("methods", nargs="*", default=list(LATERAL_METHODS))
    asked = parser.parse_args()
    batches = flown(asked.runs, asked.level, asked.seconds)
    least = deviations_of_the_bound(asked.level, asked.seconds)
    options = Options(pressure=asked.pressure)
    known = records_of(fly(1, noise=0.0), GTM, options, LIGHT[3], gusts=False).scale
    truth = np.concatenate([THETA, lateral_modal(THETA[None], known)[0]])
    names = (*LATERAL.parameters, *LATERAL.modal)
    columns, summary = [], []
    for method in asked.methods:
        made, spent = estimated(batches, method, options)
        q = quantities(made)
        good = made.converged
        value, std = q.value[good], q.std[good]
        mean, spread = np.nanmean(value, axis=0), np.nanstd(value, axis=0, ddof=1)
        columns.append((mean, spread))
        error = value[:, :15] - THETA
        rmse = np.sqrt((error**2).mean(axis=0))
        covered = (np.abs(error) <= 1.96 * std[:, :15]).mean()
        relative = np.linalg.norm(mean[:15] - THETA) / np.linalg.norm(THETA)
        ratio = np.exp(np.log(rmse / least).mean())
        bias = 100.0 * (mean[:15] - THETA) / np.abs(THETA)
        summary.append(
            (method, good.sum(), made.iterations[good].mean(), 100 * relative, ratio, 100 * covered, spent)
        )
        print(f"{method}: bias [%] " + " ".join(f"{n} {b:.2f}" for n, b in zip(names, bias, strict=False)))
        print(
            f"{method}: RMSE/bound "
            + " ".join(f"{n} {r:.2f}" for n, r in zip(names, rmse / least, strict=False))
        )
    print(
        f"\n{asked.runs} runs of {asked.seconds:g} s, {asked.level:g} x light gusts, pressure {asked.pressure}"
    )
    print("parameter".ljust(20), "truth".rjust(9), *(m.rjust(20) for m in asked.methods))
    for i, name in enumerate(names):
        cells = (f"{mean[i]:.4f} ({spread[i]:.4f})".rjust(20) for mean, spread in columns)
        print(name.ljust(20), f"{truth[i]:9.4f}", *cells)
    print("\nmethod         converged iterations RelErr[%] RMSE/bound coverage[%] ms/run")
    for method, good, iterations, relative, ratio, covered, spent in summary:
        print(
            f"{method:14} {good:9} {iterations:10.2f} {relative:9.2f} {ratio:10.2f} {covered:11.1f} {spent:6.2f}"
        )


if __name__ == "__main__":
    main()
