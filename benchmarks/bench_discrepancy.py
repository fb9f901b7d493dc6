"""Off-library flights through airtruth and three peers that learn a model from data: held-out error and time.

The flights are blind trials of the mode off-library: effects that the library lacks, gusts and sensors of the GTM. Each peer
learns (az + g)/V = alpha' - q and q' (local differentiation of the gyro) as functions of alpha, q and elevator from the
records that the tracer fits too:

* SINDy with control: sequentially thresholded least squares on polynomials of degree 3 (S. L. Brunton, J. L. Proctor and
  J. N. Kutz, IFAC-PapersOnLine 49-18 (2016) 710-715), by pysindy; the threshold that predicts the last fitted record best.
* Gaussian process: the discrepancy of the least-squares linear model, squared-exponential kernel with a length per
  input, by marginal likelihood (C. E. Rasmussen and C. K. I. Williams (2006), algorithm 2.1 and eq. (5.9)), 300 points.
* Multivariate orthogonal functions: polynomials up to degree 3, orthogonalised and selected by the predicted square error
  (V. Klein and E. A. Morelli, Aircraft System Identification (2006), section 5.4).

Held-out errors of alpha and q over their standard deviation, root mean square of both channels: of a free run from
fitted initial states and offsets (airtruth frees biases and trims, the peers two constants), and of a prediction one
sample ahead (airtruth: from its filter; the peers: from the measured state).

    pip install pysindy; python -m benchmarks.bench_discrepancy [--trials N] [--seed S] [--budget SECONDS]
    python -m benchmarks.bench_discrepancy --blind DIR [DIR ...]   # the answers of validation.blind, which have no time
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.signal import savgol_filter

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import log_paths, read_log
from airtruth.units import G0
from validation.blind import draw, trials
from validation.blind.figures import DECLARED

Array = NDArray[np.float64]
Function = Callable[[Array], Array]
"""(points, 3) alpha, q, elevator -> (points, 2) alpha' - q, q'."""
Pair = tuple[float, float]
"""Errors of a free run and one sample ahead [-]."""

SMOOTHED = 7
"""Samples of the local quadratic that differentiates the gyro."""
THRESHOLDS = (0.003, 0.01, 0.03, 0.1, 0.3)
"""Thresholds of SINDy, on scaled variables."""
POINTS = 300
"""Points of the Gaussian process."""
FITTED = 10
"""Steps of Levenberg and Marquardt for initial states and offsets of a held-out record."""
REQUIRED = 0.8
"""Error over that of the best other model that is required of airtruth [-]."""
DEGREE = 3
"""Degree of the polynomials."""


@dataclass(frozen=True)
class Record:
    """A record as the peers see it: (samples, 3) alpha, q, elevator; (samples, 2) targets; sample period [s]."""

    z: Array
    target: Array
    dt_s: float


def records_of(log: FlightLog) -> list[Record]:
    """Every run of a log."""
    found = []
    for run in range(len(log.run_ids)):
        rows = log.rows(run)
        own = {name: values[rows].astype(np.float64) for name, values in log.channels.items()}
        dt = float(np.diff(log.t_s[rows]).mean())
        q_dot = savgol_filter(own["q_rad_s"], SMOOTHED, 2, deriv=1, delta=dt)
        climb = own["theta_rad"] - own["alpha_rad"]
        lift = (own["az_m_s2"] + G0 * np.cos(climb)) / own["airspeed_m_s"]
        z = np.column_stack([own["alpha_rad"], own["q_rad_s"], own["elevator_rad"]])
        found.append(Record(z, np.column_stack([lift, q_dot]), dt))
    return found


def exponents() -> Array:
    """Exponents of all monomials of three variables up to the degree, the constant first."""
    every = [(i, j, k) for i in range(DEGREE + 1) for j in range(DEGREE + 1) for k in range(DEGREE + 1)]
    return np.array(sorted((e for e in every if sum(e) <= DEGREE), key=lambda e: (sum(e), e)))


def monomials(z: Array, powers: Array) -> Array:
    """(points, terms) values of monomials."""
    table = [np.ones_like(z), z, z * z, z * z * z]
    return np.asarray(
        np.column_stack([table[i][:, 0] * table[j][:, 1] * table[k][:, 2] for i, j, k in powers.tolist()])
    )


def sindy(fitted: list[Record], scale: tuple[Array, Array]) -> Function:
    """SINDy with control, by pysindy."""
    import pysindy as ps

    powers = exponents()

    def learn(own: list[Record], threshold: float) -> Function:
        z = np.concatenate([(r.z - scale[0]) / scale[1] for r in own])
        target = np.concatenate([r.target for r in own])
        spread = target.std(axis=0)
        optimiser = ps.STLSQ(threshold=threshold, alpha=1e-6)
        optimiser.fit(monomials(z, powers), target / spread)
        weights = np.asarray(optimiser.coef_).T * spread
        return lambda x: np.asarray(monomials(x, powers) @ weights)

    def miss(threshold: float) -> float:
        last = fitted[-1]
        try:
            predicted = learn(fitted[:-1], threshold)((last.z - scale[0]) / scale[1])
        except Exception:  # every term below the threshold
            return float("inf")
        return float((((predicted - last.target) / last.target.std(axis=0)) ** 2).mean())

    chosen = learn(fitted, min(THRESHOLDS, key=miss))
    return lambda z: chosen((z - scale[0]) / scale[1])


def gaussian_process(fitted: list[Record], scale: tuple[Array, Array]) -> Function:
    """A Gaussian process of the discrepancy of the linear model."""
    z = (np.concatenate([r.z for r in fitted]) - scale[0]) / scale[1]
    target = np.concatenate([r.target for r in fitted])
    linear = np.column_stack([np.ones(len(z)), z])
    coefficients = np.linalg.lstsq(linear, target, rcond=None)[0]
    rest = target - linear @ coefficients
    chosen = np.random.default_rng(0).choice(len(z), min(POINTS, len(z)), replace=False)
    x = z[chosen]

    def kernel(a: Array, b: Array, log: Array) -> Array:
        d = (a[:, None] - b[None]) / np.exp(log[1:4])
        return np.asarray(np.exp(2.0 * log[0] - 0.5 * (d**2).sum(axis=2)))

    parts = []
    for k in range(2):
        y = rest[chosen, k] / rest[:, k].std()

        def cost(log: Array, y: Array = y) -> float:
            try:
                root = np.linalg.cholesky(kernel(x, x, log) + np.exp(2.0 * log[4]) * np.eye(len(x)))
            except np.linalg.LinAlgError:
                return 1e10
            white = np.linalg.solve(root, y)
            return float(0.5 * white @ white + np.log(np.diag(root)).sum())

        best = minimize(
            cost,
            np.array([-0.5, 0.5, 0.5, 0.5, -0.3]),
            method="L-BFGS-B",
            bounds=[(-4, 3)] * 5,
            options={"maxiter": 25},
        ).x
        matrix = kernel(x, x, best) + np.exp(2.0 * best[4]) * np.eye(len(x))
        parts.append((best, np.linalg.solve(matrix, y) * rest[:, k].std()))

    def function(raw: Array) -> Array:
        own = (raw - scale[0]) / scale[1]
        more = np.column_stack([kernel(own, x, log) @ weight for log, weight in parts])
        return np.asarray(np.column_stack([np.ones(len(own)), own]) @ coefficients + more)

    return function


def orthogonal_functions(fitted: list[Record], scale: tuple[Array, Array]) -> Function:
    """Multivariate orthogonal functions, selected by the predicted square error."""
    z = (np.concatenate([r.z for r in fitted]) - scale[0]) / scale[1]
    target = np.concatenate([r.target for r in fitted])
    powers = exponents()
    every = monomials(z, powers)
    made = [_selected(every, target[:, k]) for k in range(2)]
    weights = np.column_stack(made)
    return lambda raw: np.asarray(
        np.prod(((raw - scale[0]) / scale[1])[:, None] ** powers[None], axis=2) @ weights
    )


def _selected(every: Array, y: Array) -> Array:
    """Weights of the monomials: orthogonalised, taken in the order of what they explain, as far as PSE falls."""
    left, order, n = list(range(every.shape[1])), [], len(y)
    basis: list[Array] = []
    rest = y.copy()
    most = float(y.var())  # largest variance of the fit error: that of the mean (eq. (5.112))
    best, kept = np.inf, 0
    while left and len(order) < 15:
        gains = []
        for i in left:
            p = every[:, i] - sum((b * (b @ every[:, i]) for b in basis), np.zeros(n))
            size = float(np.sqrt(p @ p))
            gains.append((p @ rest / size) ** 2 if size > 1e-6 * np.sqrt(n) else 0.0)
        i = left.pop(int(np.argmax(gains)))
        p = every[:, i] - sum((b * (b @ every[:, i]) for b in basis), np.zeros(n))
        basis.append(p / np.sqrt(max(p @ p, 1e-300)))
        order.append(i)
        rest = rest - basis[-1] * (basis[-1] @ rest)
        pse = float(rest @ rest) / n + most * len(order) / n
        if pse < best:
            best, kept = pse, len(order)
    weights = np.zeros(every.shape[1])
    weights[order[:kept]] = np.linalg.lstsq(every[:, order[:kept]], y, rcond=None)[0]
    return weights


def stepped(function: Function, x: Array, elevator: Array, dt_s: float, offset: Array) -> Array:
    """One Runge-Kutta step of (points, 2) states; elevator (points, 3) at its start, middle and end."""

    def rate(state: Array, k: int) -> Array:
        made = function(np.column_stack([state, elevator[:, k]])) + offset
        return np.column_stack([state[:, 1] + made[:, 0], made[:, 1]])

    a = rate(x, 0)
    b = rate(x + 0.5 * dt_s * a, 1)
    c = rate(x + 0.5 * dt_s * b, 1)
    d = rate(x + dt_s * c, 2)
    return np.asarray(x + dt_s / 6.0 * (a + 2.0 * b + 2.0 * c + d))


def errors(function: Function, record: Record, spread: Array) -> Pair:
    """Free run and one step ahead: root mean square of alpha and q over their standard deviation."""
    x, e = record.z[:, :2], record.z[:, 2]
    inputs = np.column_stack([e[:-1], 0.5 * (e[:-1] + e[1:]), e[1:]])
    mean = np.mean(
        (np.diff(x, axis=0) / record.dt_s)
        - np.column_stack([x[:-1, 1], np.zeros(len(x) - 1)])
        - function(record.z[:-1]),
        axis=0,
    )
    ahead = (stepped(function, x[:-1], inputs, record.dt_s, mean) - x[1:]) / spread

    def run(free: Array) -> Array:
        """(runs, samples, 2) free runs from (runs, 4) initial states and offsets."""
        states = np.zeros((len(free), *x.shape))
        states[:, 0] = free[:, :2]
        for k in range(len(x) - 1):
            own = np.repeat(inputs[k : k + 1], len(free), axis=0)
            states[:, k + 1] = np.clip(
                stepped(function, states[:, k], own, record.dt_s, free[:, 2:]), -3.0, 3.0
            )
        return states

    point = np.concatenate([x[:5].mean(axis=0), mean])
    step = np.array([1e-4, 1e-3, 1e-3, 1e-2])
    best, left = np.inf, np.zeros_like(x)
    tried, damping = point, 1e-3
    for _ in range(FITTED):
        runs = run(tried + np.vstack([np.zeros(4), np.diag(step)]))
        rest = (runs[0] - x) / spread
        cost = float((rest**2).mean())
        if cost < best:
            best, point, left, damping = cost, tried, rest, 0.3 * damping
            slopes = ((runs[1:] - runs[0]) / spread).reshape(4, -1)
        else:
            damping *= 10.0
        information = slopes @ slopes.T
        information += damping * np.diag(np.diag(information))
        tried = point - np.linalg.solve(information, slopes @ left.ravel()) * step
    return float(np.sqrt(best)), float(np.sqrt((ahead**2).mean()))


PEERS: dict[str, Callable[[list[Record], tuple[Array, Array]], Function]] = {
    "SINDy": sindy,
    "Gaussian process": gaussian_process,
    "orthogonal functions": orthogonal_functions,
}
"""What learns a model from records, whose inputs are scaled by the given mean and standard deviation."""


@dataclass(frozen=True)
class Trial:
    """A blind trial that was answered.

    Attributes
    ----------
    label, cause, log, answer : its name, the undeclared effect, its records and the answer to them.
    seconds : processor time of the trace [s].
    oracle : root mean square of alpha [rad] and q [rad/s] that a free run of the true aircraft leaves on the held-out records.
    """

    label: str
    cause: str
    log: Path
    answer: dict[str, Any]
    seconds: float = float("nan")
    oracle: Mapping[str, float] | None = None


def flown(seed: int, count: int, budget_s: float, folder: Path) -> Iterator[Trial]:
    """Trials of the mode off-library, flown and traced here."""
    for number in range(count):
        (path,) = trials.frozen(seed, [number], "off-library", folder)
        (log,) = log_paths(path)
        (effect,) = draw.draw(seed, number, "off-library").effects
        from airtruth.tracing import TraceOptions, trace  # the process that flies the trials must not load it

        began = time.process_time()
        answer = trace(log, DECLARED, TraceOptions(time_budget_s=budget_s)).to_dict()
        yield Trial(path.name, effect.key, log, answer, time.process_time() - began)


def answered(folder: Path) -> Iterator[Trial]:
    """Trials of a folder of `validation.blind`, with the answers that it has."""
    for path in sorted((folder / "answer").glob("*.json")):
        answer = json.loads(path.read_text())
        truth = json.loads((folder / "truth" / path.name).read_text())
        (effect,) = truth["trial"]["effects"]
        if "failed" not in answer:
            log = folder / "logs" / path.stem / "log.parquet"
            yield Trial(path.stem, effect["key"], log, answer, oracle=truth["oracle"]["free_run"])


def ours(answer: dict[str, Any]) -> dict[str, Pair]:
    """Errors of the stages *declared*, *before* and *after* of an answer."""
    error = answer["error"]

    def over(stage: str, kind: str) -> float:
        return over_signal(error[stage]["held_out"][kind], answer)

    stages = [s for s in ("declared", "before", "after") if s in error]
    return {s: (over(s, "free_run"), over(s, "innovation")) for s in stages}


def over_signal(error: Mapping[str, float], answer: dict[str, Any]) -> float:
    """Root mean square of the errors of alpha and q over their signals in an answer."""
    signal = answer["error"]["channels"]
    return float(np.sqrt(np.mean([(error[n] / signal[n]) ** 2 for n in ("alpha_rad", "q_rad_s")])))


def compared(trial: Trial) -> dict[str, tuple[float, float, float]]:
    """Free run, one sample ahead and processor time [s] of every model on a trial; "airtruth" is its last stage."""
    own = records_of(read_log(trial.log))
    held = own[2::3]
    fitted = [r for r in own if not any(r is h for h in held)]
    whole = np.concatenate([r.z for r in fitted])
    scale = (whole.mean(axis=0), whole.std(axis=0))
    rows: dict[str, tuple[float, float, float]] = {}
    for name, learn in PEERS.items():
        began = time.process_time()
        function = learn(fitted, scale)
        spent = time.process_time() - began
        pairs = [errors(function, r, scale[1][:2]) for r in held]
        free, ahead = np.sqrt(np.mean(np.array(pairs) ** 2, axis=0))
        rows[name] = (float(free), float(ahead), spent)
    rows |= {f"airtruth, {stage}": (*pair, trial.seconds) for stage, pair in ours(trial.answer).items()}
    rows["airtruth"] = rows.get("airtruth, after", rows["airtruth, before"])
    if trial.oracle is not None:
        rows["true aircraft"] = (over_signal(trial.oracle, trial.answer), np.nan, np.nan)
    return rows


def line(name: str, row: Iterable[float]) -> str:
    """A row of a table; a value that was not measured is left out."""
    return f"  {name:24}" + "".join(f"{value:12.4f}" if np.isfinite(value) else "" for value in row)


def summary(causes: list[str], every: list[dict[str, tuple[float, float, float]]]) -> str:
    """Medians of every model, and the error of airtruth over that of the best other model of each trial."""
    lines = [f"median of {len(every)} trials: free run, one sample ahead, seconds"]
    for name in [*PEERS, "airtruth, declared", "airtruth, before", "airtruth"]:
        median = np.median([rows[name] for rows in every], axis=0)
        lines.append(line(name, median))
    best = np.array([np.min([rows[name][:2] for name in PEERS], axis=0) for rows in every])
    ratio = np.array([rows["airtruth"][:2] for rows in every]) / best
    lines.append(
        "airtruth over the best other model of each trial: median, quartiles, share of trials below 1"
    )
    for k, kind in enumerate(("free run", "one sample ahead")):
        low, middle, high = np.quantile(ratio[:, k], [0.25, 0.5, 0.75])
        lines.append(f"  {kind:24}{middle:12.2f}{low:8.2f}{high:6.2f}{np.mean(ratio[:, k] < 1.0):8.2f}")
    if "true aircraft" in every[0]:
        limit = np.array([rows["true aircraft"][0] for rows in every]) / best[:, 0]
        attainable = ratio[limit < REQUIRED, 0]
        within = float(np.median(attainable)) if attainable.size else float("nan")
        lines.append(
            f"free run of the true aircraft over that of the best other model: median {np.median(limit):.2f}, below "
            f"{REQUIRED} in {np.mean(limit < REQUIRED):.2f} of the trials; there that of airtruth has {within:.2f}"
        )
    lines.append(
        "by the cause: trials, median in the free run and one sample ahead, trials at or above 1 in either"
    )
    for cause in sorted(set(causes)):
        rows = ratio[[c == cause for c in causes]]
        free, ahead = np.median(rows, axis=0)
        lost = int((rows >= 1.0).any(axis=1).sum())
        lines.append(f"  {cause:32}{len(rows):4d}{free:8.2f}{ahead:8.2f}{lost:4d}")
    return "\n".join(lines)


def main() -> None:
    """Print one table per trial and the medians."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--blind", type=Path, nargs="+", help="folders of validation.blind whose answers serve"
    )
    parser.add_argument("--trials", type=int, default=6, help="flown and traced here, without --blind")
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--budget", type=float, default=120.0, help="of a trace [s]")
    chosen = parser.parse_args()
    causes, every = [], []
    with tempfile.TemporaryDirectory() as folder:
        source = (
            chain.from_iterable(answered(blind) for blind in chosen.blind)
            if chosen.blind
            else flown(chosen.seed, chosen.trials, chosen.budget, Path(folder))
        )
        for trial in source:
            rows = compared(trial)
            causes.append(trial.cause)
            every.append(rows)
            print(
                f"\n{trial.label}, {trial.cause} ({trial.answer['verdict']}): free run, one sample ahead, seconds"
            )
            for name, row in rows.items():
                print(line(name, row), flush=True)
    print(f"\n{summary(causes, every)}")


if __name__ == "__main__":
    main()
