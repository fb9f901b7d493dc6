"""How much the records of a trial tell of an effect, and what error the truth itself leaves on them.

The noncentrality of a trial's effect is |(1 - P) W d|^2, here to first order; `blind.refit` refits in earnest.

- d: difference of alpha, q and az between twins flown in calm air with and without the effect; for an effect
  that grows smoothly, of an eighth of it times eight, as a refit is not linear where this projection is.
- W whitens gust response and sensor noise, by a vector autoregression fitted to gust-only flights of the
  truth (Luetkepohl, New Introduction to Multiple Time Series Analysis, 2005, section 3.2).
- P projects on what a tracer refits: freely, biases and initial state of every record, and constants in CL
  and Cm, which place the trim on tables that break; with their declared uncertainty as prior rows,
  derivatives, mass, inertia and CG.

Records that a tracer holds out do not count. What gusts tell of an effect besides the manoeuvre is not in
it, so in rough air it is a lower bound for effects of the vane.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from validation.blind import gusts, sensors, surface
from validation.blind.aircraft_xml import Shape, nuisances
from validation.blind.draw import AIRS, Trial, fly_record, stream, truth_of
from validation.blind.figures import (
    CHANNELS,
    DEG,
    DERIVATIVES,
    LENGTH_M,
    LOG_STEP_S,
    NOISE,
    QUANTUM,
    SIGMA_M_S,
    SPAN_M,
    STEP_S,
    STRONG,
    held_out,
)
from validation.blind.flight import Model, Truth
from validation.blind.sizes import SIZE16
from validation.blind.truths import EFFECTS, LIBRARY, Added, Parts, shrunk

Array = NDArray[np.float64]

ORDER: Final = 10
"""Of the autoregression at 50 Hz; 0.2 s."""
_LEAST_ORDER: Final = 4
COARSE_S: Final = 0.004
_GUST_FLIGHTS: Final = 6
_GUST_FLIGHT_S: Final = 30.0
_SETTLE_S: Final = 4.0
_SHARE: Final = 0.125
TRIMS: Final = (Shape("CL", "one", 0.01), Shape("Cm", "one", 0.003))
_STATE_SHIFT_S: Final = 0.1
_RIVALS: Final = 2
_NEXT_TO_NONE: Final = 1e-3


@dataclass(frozen=True)
class Whitener:
    """e[t] = root^-1 (y[t] - sum_k coefficients[k] y[t-1-k]); coefficients (order, m, m), root (m, m) lower."""

    coefficients: Array
    root: Array

    def __call__(self, y: Array) -> Array:
        """(..., samples, m) -> (..., samples - order, m)."""
        order = len(self.coefficients)
        e = y[..., order:, :].copy()
        for k, a in enumerate(self.coefficients):
            e -= y[..., order - 1 - k : y.shape[-2] - 1 - k, :] @ a.T
        return np.asarray(np.linalg.solve(self.root, e[..., None])[..., 0])


def autoregression(series: Sequence[Array], order: int = ORDER) -> Whitener:
    """Least-squares vector autoregression of series (samples, m), each about its mean."""
    centred = [s - s.mean(axis=0) for s in series]
    now = np.concatenate([s[order:] for s in centred])
    past = np.concatenate(
        [np.hstack([s[order - 1 - k : len(s) - 1 - k] for k in range(order)]) for s in centred]
    )
    solution = np.linalg.lstsq(past, now, rcond=None)[0]
    residual = now - past @ solution
    covariance = residual.T @ residual / (len(now) - past.shape[1])
    m = now.shape[1]
    return Whitener(solution.T.reshape(m, order, m).transpose(1, 0, 2).copy(), np.linalg.cholesky(covariance))


@dataclass(frozen=True)
class Projection:
    """What refitting takes up, to first order.

    Attributes
    ----------
    basis : (n + p, r) orthonormal, of whitened directions with a row for each of p priors.
    """

    basis: Array

    @classmethod
    def of(cls, free: Array, prior: Array) -> Projection:
        """Of directions (n, f) without a prior and (n, p) per prior standard deviation."""
        top = np.hstack([free, prior])
        rows = np.zeros((prior.shape[1], top.shape[1]))
        rows[:, free.shape[1] :] = np.eye(prior.shape[1])
        x = np.vstack([top, rows])
        scale = np.linalg.norm(x, axis=0)
        u, s, _ = np.linalg.svd(x / np.where(scale > 0.0, scale, 1.0), full_matrices=False)
        return cls(u[:, s > 1e-10 * s[0]])

    def left(self, d: Array) -> Array:
        """(n + p,) what is left of a whitened difference (n,)."""
        target = np.concatenate([d, np.zeros(len(self.basis) - len(d))])
        return np.asarray(target - self.basis @ (self.basis.T @ target))

    def rest(self, d: Array) -> float:
        """Squared length of what is left of a whitened difference (n,)."""
        left = self.left(d)
        return float(left @ left)


def noncentrality(d: Array, free: Array, prior: Array) -> float:
    """Squared length of a whitened difference that nothing refitted can take up.

    Parameters
    ----------
    d : (n,) whitened difference.
    free, prior : as of `Projection.of`.
    """
    return Projection.of(free, prior).rest(d)


def stacked(clean: Mapping[str, Array]) -> Array:
    """alpha, q, az side by side, (samples, 3)."""
    return np.column_stack([clean[name] for name in CHANNELS])


def noise_model(trial: Trial, air: str) -> Whitener:
    """Whitener of gust response and sensor noise, by flights of the trial's aircraft without effect or input."""
    truth, parts = truth_of(trial, (), COARSE_S)
    step_s = trial.log_step_s
    rest = surface.Manoeuvre("doublet", 0.0, 1.0, 0.5, log_step_s=step_s)
    series = []
    still = stacked(fly_record(truth, parts, rest, _GUST_FLIGHT_S, 0.2)) if air == "calm" else None
    for index in range(_GUST_FLIGHTS):
        rng = stream(trial.seed, trial.number, 300 + index)
        if still is None:
            count = round((_SETTLE_S + _GUST_FLIGHT_S) / COARSE_S) + 1
            gust = gusts.synthesise(
                trial.spectrum,
                SIGMA_M_S[air],
                LENGTH_M,
                truth.airspeed_m_s,
                SPAN_M,
                COARSE_S,
                count,
                rng,
            )
            if not trial.rotary:
                gust[2] = 0.0
            y = stacked(fly_record(truth, parts, rest, _GUST_FLIGHT_S, _SETTLE_S, gust))
        else:
            y = still
        series.append(y + _noise(trial.noise, len(y), rng, step_s))
    return autoregression(series, max(_LEAST_ORDER, round(ORDER * LOG_STEP_S / step_s)))


def _noise(kind: str, count: int, rng: np.random.Generator, log_step_s: float) -> Array:
    columns = []
    for name in CHANNELS:
        column = sensors.noise(name, kind, count, rng, log_step_s)
        if kind == "quantised" and name in QUANTUM:
            column += QUANTUM[name] * rng.uniform(-0.5, 0.5, count)
        columns.append(column)
    return np.column_stack(columns)


@dataclass(frozen=True)
class Directions:
    """What a tracer may refit, whitened: (n, f) free, (n, p) per prior standard deviation."""

    free: Array
    prior: Array

    @cached_property
    def projection(self) -> Projection:
        """What they take up."""
        return Projection.of(self.free, self.prior)


def fitted(trial: Trial) -> list[int]:
    """Records that are not held out."""
    count = len(trial.manoeuvres)
    return [k for k in range(count) if k not in held_out(count)]


def flown(trial: Trial, truth: Truth, parts: Parts) -> Array:
    """Noise-free alpha, q, az of the fitted records of a truth in calm air, (records, samples, 3)."""
    return np.array(
        [stacked(fly_record(truth, parts, trial.manoeuvres[k], trial.duration_s, 0.2)) for k in fitted(trial)]
    )


def responses(trial: Trial, effects: Sequence[Added], step_s: float, model: Model | None = None) -> Array:
    """`flown` of the trial's aircraft with these effects, or of another model without any."""
    if model is None:
        return flown(trial, *truth_of(trial, effects, step_s))
    return flown(trial, Truth(model, step_s), Parts())


def initial_states(truth: Truth, samples: int, log_step_s: float = LOG_STEP_S) -> Array:
    """Two responses that span those of the initial state, (2, samples, 3)."""
    every, shift = round(log_step_s / truth.step_s), round(_STATE_SHIFT_S / log_step_s)
    steps = (samples + shift) * every
    still = np.zeros(steps)
    moved = sensors.measured(truth.fly(still, None, 0.3 * DEG), (), 0.0, 0.0, truth.step_s, log_step_s)
    rest = sensors.measured(truth.fly(still, None, 0.0), (), 0.0, 0.0, truth.step_s, log_step_s)
    y = stacked(moved) - stacked(rest)
    return np.array([y[:samples], y[shift : shift + samples]])


def own_directions(trial: Trial, whiten: Whitener, records: int, samples: int) -> Array:
    """Initial states and biases of every record, whitened, (n, 5 records)."""
    m = len(CHANNELS)
    states = whiten(initial_states(Truth(Model(trial.body), COARSE_S), samples, trial.log_step_s))
    constants = whiten(np.eye(m)[:, None, :].repeat(samples, axis=1))
    own = np.concatenate([states, constants]).reshape(len(states) + m, -1).T
    return np.kron(np.eye(records), own)


def directions(trial: Trial, whiten: Whitener) -> Directions:
    """Biases, initial states, the trim, derivatives, mass, inertia and CG of a trial."""
    base = responses(trial, (), COARSE_S, Model(trial.body))
    free = own_directions(trial, whiten, *base.shape[:2])
    columns = []
    for step, part in nuisances(trial.body).values():
        moved = responses(trial, (), COARSE_S, Model(step))
        columns.append(whiten(moved - base).ravel() / part)
    trims = []
    for shape in TRIMS:
        moved = responses(trial, (), COARSE_S, Model(trial.body, (shape,)))
        trims.append(whiten(moved - base).ravel())
    return Directions(np.column_stack([free, *trims]), np.column_stack(columns))


def beyond(trial: Trial, d: Array, whiten: Whitener, along: Directions) -> float:
    """What of a whitened difference is left after the best single effect of the library, at any size."""
    base = responses(trial, (), COARSE_S)
    return nearest(trial, d, whiten, along, LIBRARY, base)[0][2]


def nearest(
    trial: Trial,
    d: Array,
    whiten: Whitener,
    along: Directions,
    keys: Iterable[str],
    base: Array,
    others: Sequence[Added] = (),
) -> list[tuple[str, float, float]]:
    """What of a whitened difference single effects leave at any size: key, place (0 to 1), rest; the best first.

    Effects are taken to first order at their nominal size; those with a place at three places.

    Parameters
    ----------
    base : responses with the ``others`` alone.
    """
    own, left = along.projection.left(d), []
    for key in keys:
        kind = EFFECTS[key]
        size = min(SIZE16[key][AIRS.index(trial.air)], kind.largest)
        for place in (0.0, 0.5, 0.99) if key.endswith(":break") else (0.5,):
            effect = Added(key, kind.values(size, place))
            other = along.projection.left(whiten(difference(trial, effect, others, COARSE_S, base)).ravel())
            rest = float(own @ own - (own @ other) ** 2 / max(float(other @ other), 1e-12))
            left.append((key, place, rest))
    return sorted(left, key=lambda item: item[2])


def apart(
    trial: Trial,
    effect: Added,
    d: Array,
    whiten: Whitener,
    along: Directions,
    others: Sequence[Added] = (),
) -> float:
    """What of an effect the best effect of another name leaves, flown at the size that leaves least.

    Of the effects that come nearest to first order, if that is near; everything else refitted to first order. Not of
    a wrong airspeed, which moves no output.

    Parameters
    ----------
    d : whitened difference that the effect makes, to first order.
    others : effects beside it, whose sizes are refitted to first order too; their names are no rivals.
    """
    target = responses(trial, (*others, effect), COARSE_S)
    base = responses(trial, others, COARSE_S)
    if others:
        rest = [tuple(e for e in others if e is not other) for other in others]
        sizes = [whiten(difference(trial, o, r, COARSE_S)).ravel() for o, r in zip(others, rest, strict=True)]
        along = replace(along, free=np.column_stack([along.free, *sizes]))

    def left(made: Array) -> float:
        return along.projection.rest(whiten(target - made).ravel())

    def rival(key: str, size: float, place: float) -> Array:
        try:
            return responses(trial, (*others, Added(key, EFFECTS[key].values(float(size), place))), COARSE_S)
        except RuntimeError:  # it cannot be trimmed there
            return base

    best = left(base)
    keys = _rivals({e.name for e in (effect, *others)})
    for key, place, rest_left in nearest(trial, d, whiten, along, keys, base, others)[:_RIVALS]:
        if rest_left > STRONG:
            break
        kind = EFFECTS[key]
        ends = (-kind.largest if kind.signed else _NEXT_TO_NONE * kind.largest, kind.largest)
        found = minimize_scalar(
            lambda size, key=key, place=place: left(rival(key, size, place)),
            bounds=ends,
            method="bounded",
            options={"xatol": _NEXT_TO_NONE * kind.largest},
        )
        best = min(best, float(found.fun))
    return best


def _rivals(names: Collection[str]) -> list[str]:
    """Keys of the library's effects of other names; a wrong airspeed moves no output and is none."""
    return [key for key in LIBRARY if Added(key, {}).name not in names and key != "airspeed_scale"]


def difference(
    trial: Trial,
    effect: Added,
    others: Sequence[Added] = (),
    step_s: float = STEP_S,
    without: Array | None = None,
) -> Array:
    """What an effect adds to alpha, q and az beside others, calm air, (records, samples, 3).

    Parameters
    ----------
    without : the responses with the others alone, where they are known.
    """
    if effect.key == "airspeed_scale":
        return _airspeed(trial, effect.values["factor"])
    share = _SHARE if EFFECTS[effect.key].smooth else 1.0
    full = responses(trial, (*others, shrunk(effect, share)), step_s)
    base = responses(trial, others, step_s) if without is None else without
    return (full - base) / share


def _airspeed(trial: Trial, factor: float) -> Array:
    """What a wrong airspeed does to alpha, q and az as a tracer predicts them, to first order.

    It reads q_bar as factor^2 and the rate terms' q_bar/V as factor times what they are, so the aircraft looks
    to it as one with derivatives divided by these; the 1/V of the kinematics is left out.
    """
    errors = dict(trial.body.derivatives)
    for name in DERIVATIVES:
        power = 1.0 if name.endswith("q") else 2.0
        errors[name] = errors.get(name, 0.0) - _SHARE * power * (factor - 1.0)
    seen = replace(trial.body, derivatives=errors)
    moved = responses(trial, (), COARSE_S, Model(seen))
    return (moved - responses(trial, (), COARSE_S, Model(trial.body))) / _SHARE


def oracle(trial: Trial, records: Sequence[Array]) -> dict[str, dict[str, float]]:
    """Free-run error of the truth on the held-out records, biases and initial state free; and their size.

    Parameters
    ----------
    records : (samples, 3) logged alpha, q, az of every record.

    Returns
    -------
    dict
        "free_run" and "signal": channel -> rms over the held-out records.
    """
    truth, parts = truth_of(trial, (*trial.effects, *trial.clutter))
    samples = len(records[0])
    states = initial_states(truth, samples, trial.log_step_s)
    weight = 1.0 / np.array([NOISE[name] for name in CHANNELS])
    columns = np.concatenate([states, np.eye(3)[:, None, :].repeat(samples, axis=1)])
    x = (columns * weight).reshape(len(columns), -1).T
    errors, signals = [], []
    for k in held_out(len(records)):
        y = stacked(fly_record(truth, parts, trial.manoeuvres[k], trial.duration_s, 0.2))
        gap = ((records[k] - y) * weight).ravel()
        left = gap - x @ np.linalg.lstsq(x, gap, rcond=None)[0]
        errors.append(left.reshape(samples, 3) / weight)
        signals.append(records[k] - records[k].mean(axis=0))
    return {
        kind: dict(zip(CHANNELS, np.sqrt(np.mean(np.square(values), axis=(0, 1))).tolist(), strict=True))
        for kind, values in (("free_run", errors), ("signal", signals))
    }
