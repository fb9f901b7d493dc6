"""Time of the lateral estimators beside peers; plain `python -m benchmarks.bench_lateral [RECORDS]`.

Records of the affine GTM in light gusts with its sensors, at 50 Hz. Regressions: 5 s each, 100 different ones repeated. Their
baseline is a loop over linearmodels' IV2SLS on the same instruments and regressors, one equation after another: one IV step, with
its own covariance. Likelihood: 10 s. Its baseline is statsmodels' Kalman filter in the same matrices: one step of
scoring needs cost, gradient and information, for which a program that has the likelihood alone takes one evaluation for each
parameter and one more. Times are CPU of one core, the best of three.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
from linearmodels.iv import IV2SLS
from statsmodels.tsa.statespace.kalman_filter import KalmanFilter

from airtruth.identification import LATERAL_METHODS, Options, identify_batch
from airtruth.identification.lateral.observation import observe
from airtruth.identification.lateral.predictor import levels, outputs_of, records_of
from airtruth.identification.lateral.problems import smoothed
from airtruth.identification.lateral.solve import POSES
from airtruth.identification.likelihood.fit import Records, scored
from airtruth.identification.likelihood.linearise import matrices
from airtruth.identification.likelihood.method import GUST_LENGTH_M
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LATERAL
from validation.affine_lateral import GTM, LIGHT, NOISE, THETA, fly

DISTINCT, STEPS, RECORDS = 100, 10, 2000
BAR_US, BAR_MS = 60.0, 6.0
PLAIN = Options(covariance="none")


def cpu_s(work: Callable[[], object], repeat: int = 3) -> float:
    """Least CPU time [s] of a few repetitions, after one to compile."""
    work()
    best = np.inf
    for _ in range(repeat):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def part(batch: Batch, runs: np.ndarray) -> Batch:
    """Some runs, which may repeat."""
    names = tuple(f"{batch.run_ids[run]}/{k}" for k, run in enumerate(runs))
    return Batch(names, batch.dt_s, batch.t_s[runs], {name: x[runs] for name, x in batch.channels.items()})


def linearmodels_loop(batch: Batch, name: str) -> float:
    """CPU time [s] per run of one IV2SLS step in each equation, its matrices made beforehand."""
    theta = identify_batch(batch, GTM, name, PLAIN, LATERAL).theta
    o = observe(batch, GTM, PLAIN)
    pose = POSES[name]
    assert pose is not None
    rows = pose(o, PLAIN, smoothed(o, PLAIN)).rows(theta, np.arange(len(theta)))

    def loop() -> None:
        for y, x, z in zip(rows.y, rows.x, rows.z, strict=True):
            for equation in y:
                IV2SLS(equation, None, x.T, z.T).fit()

    return cpu_s(loop) / len(theta)


def regressions(records: int) -> None:
    """Microseconds per run of each regression."""
    distinct = fly(runs=DISTINCT, seconds=5.0, gust=1.0, seed=1)
    many = part(distinct, np.arange(records) % DISTINCT)
    print(f"{records} records of 5 s, microseconds of one core per run")
    print(f"{'method':14}{'estimate':>10}{'+ intervals':>13}{'IV2SLS loop':>13}{'ratio':>8}")
    for name in POSES:
        bare, full = (
            1e6 * cpu_s(lambda o=o, n=name: identify_batch(many, GTM, n, o, LATERAL)) / records
            for o in (PLAIN, Options())
        )
        line = f"{name:14}{bare:10.1f}{full:13.1f}"
        if POSES[name] is not None:
            loop = 1e6 * linearmodels_loop(part(distinct, np.arange(STEPS)), name)
            line += (
                f"{loop:13.0f}{loop / bare:8.0f}   bar {BAR_US:.0f}: {'met' if bare <= BAR_US else 'MISSED'}"
            )
        print(line)


def peer_filter(data: Records, z: np.ndarray) -> KalmanFilter:
    """The predictor of the first run as statsmodels' filter."""
    step = matrices(data.layout, np.arange(1), z, data.dt_s)
    states, _, outputs, _ = data.layout.sizes
    y, u, bend = (x[0] for x in data.signals)
    model = KalmanFilter(k_endog=outputs, k_states=states, transition=step.phi[0], design=step.c[0])
    model.bind(np.ascontiguousarray(y))
    model["selection"], model["state_cov"] = np.eye(states), step.noise[0]
    model["obs_cov"], model["obs_intercept"] = (
        np.diag(step.variance[0]),
        np.ascontiguousarray((u @ step.d[0].T).T),
    )
    moved = (u[:-1] + bend[1:]) @ step.early[0].T + (u[1:] + bend[1:]) @ step.late[0].T
    model["state_intercept"] = np.ascontiguousarray(np.vstack([moved, np.zeros(states)]).T)
    model.initialize_approximate_diffuse(1.0)
    return model


def likelihood() -> None:
    """Milliseconds per run of the likelihood methods, and of one step of scoring beside statsmodels."""
    batch = fly(runs=40, gust=1.0, seed=3)
    runs = len(batch.run_ids)
    print(f"\n{runs} records of 10 s, milliseconds of one core per run")
    for name in LATERAL_METHODS:
        if name in ("filter-error", "output-error"):
            spent = 1e3 * cpu_s(lambda n=name: identify_batch(batch, GTM, n, motion=LATERAL)) / runs
            steps = identify_batch(batch, GTM, name, motion=LATERAL).iterations.mean()
            print(
                f"{name:14}{spent:8.1f}  iterations {steps:5.1f}   bar {BAR_MS:.0f}: {'met' if spent <= BAR_MS else 'MISSED'}"
            )
    data = records_of(batch, GTM, Options(), GUST_LENGTH_M, gusts=True)
    noise = {f"noise_{o.name}": NOISE[o.channel] for o in LATERAL.outputs}
    known = {"sigma_v": LIGHT[1], **noise, "noise_p_dot": 1e-3, "noise_r_dot": 1e-3}
    names = levels(outputs_of(batch), gusts=True)
    z = np.concatenate([THETA, np.log([known[name] for name in names])])[None]
    free, every = np.arange(z.shape[1]), np.arange(runs)
    ours = 1e3 * cpu_s(lambda: scored(data, np.repeat(z, runs, axis=0), every, free)) / runs
    model = peer_filter(data, z)
    single = 1e3 * cpu_s(model.loglike)
    theirs = single * (free.size + 1)
    print(
        f"one step of scoring {ours:.2f}; statsmodels: one likelihood {single:.2f}, with differences for {free.size} parameters "
        f"{theirs:.1f}, ratio {theirs / ours:.0f}"
    )


def main() -> None:
    """Print both tables."""
    regressions(int(sys.argv[1]) if len(sys.argv) > 1 else RECORDS)
    likelihood()


if __name__ == "__main__":
    main()
