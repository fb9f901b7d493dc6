"""The noncentrality of an effect when everything else is refitted by the truth itself, not to first order.

Mass, CG and elevator errors move the trim, and tables that break answer in steps: an eighth of a mass error,
projected to first order, is up to twelve times as strong as what a refit leaves of the whole error.

Gauss-Newton with halving steps, from two starts: the trial's own aircraft, and that trimmed, by constants in
CL and Cm, where the aircraft with the effect is. It may end in a local minimum: an upper bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from validation.blind.aircraft_xml import Body, Shape
from validation.blind.causes import COMPOSITIONS, DECLARED, increments
from validation.blind.draw import Trial, open_loop
from validation.blind.figures import (
    APART,
    BEYOND,
    BODY,
    CONDITIONS,
    DERIVATIVES,
    LEAVE_ONE_OUT,
    STRONG,
    TOGETHER,
)
from validation.blind.flight import Truth
from validation.blind.information import (
    COARSE_S,
    TRIMS,
    Directions,
    Whitener,
    apart,
    beyond,
    difference,
    directions,
    flown,
    noise_model,
    own_directions,
)
from validation.blind.truths import EFFECTS, Added, Parts, combined, model

Array = NDArray[np.float64]

_NAMES: Final = tuple(DERIVATIVES)
_PRIOR: Final = len(_NAMES) + len(BODY)
_FREE: Final = len(TRIMS)
_STEP: Final = 0.25
_ITERATIONS: Final = 10
_HALVINGS: Final = 5
_TRIM_ITERATIONS: Final = 4
_ALIKE: Final = 0.01
_SMALL, _MEDIUM, _LARGE = 12.0, 40.0, 300.0


def lambdas(trial: Trial) -> dict[str, float]:
    """Noncentrality of each effect of the trial, the others being there.

    To first order where that is enough: of a small effect, one too small to be found, or one so large that
    no class divides it, if it leaves the trim alone; and of a wrong airspeed.
    """
    if not trial.effects:
        return {}
    trial = open_loop(trial, noisy=False)
    whiten = noise_model(trial, trial.air)
    along = directions(trial, whiten)
    everything = (*trial.effects, *trial.clutter)
    result = {}
    for effect in trial.effects:
        others = tuple(e for e in everything if e is not effect)
        d = whiten(difference(trial, effect, others)).ravel()
        value = along.projection.rest(d)
        if _moves_derivatives(trial, effect) or refit_needed(trial, effect, others, value):
            value = _one(trial, effect, others, whiten)
        result[effect.key] = value
        if trial.composition == "triple":
            least = min(value, apart(trial, effect, d, whiten, along, others))
            result[APART] = min(least, result.get(APART, least))
        if trial.composition in (*COMPOSITIONS, *CONDITIONS):
            continue
        if not EFFECTS[effect.key].library and value > STRONG:
            result[BEYOND] = min(value, beyond(trial, d, whiten, along))
        elif len(everything) == 1 and value > STRONG and effect.key != "airspeed_scale":
            key = BEYOND if trial.composition == LEAVE_ONE_OUT else APART
            result[key] = min(value, apart(trial, effect, d, whiten, along))
    if trial.composition in COMPOSITIONS and len(trial.effects) > 1:
        result[TOGETHER] = together(trial, whiten, along)
    return result


def _moves_derivatives(trial: Trial, effect: Added) -> bool:
    """Whether derivatives imitate an effect of a set, so that its neighbours change what it does."""
    return trial.composition in COMPOSITIONS and bool(imitation((effect,)).any())


def _one(trial: Trial, effect: Added, others: Sequence[Added], whiten: Whitener) -> float:
    if trial.composition not in COMPOSITIONS:
        return refitted(trial, effect, others, whiten)
    beside = combined(others)
    return _refitted(trial, beside, beside + combined((effect,)), whiten, imitation((effect,)))


def imitation(effects: Sequence[Added]) -> Array:
    """Derivatives that act as the effects do, in standard deviations, (nuisances and constants,).

    A start close to the least; from the trial's own aircraft the search can end far above it.
    """
    off = dict.fromkeys(_NAMES, 0.0)
    for effect in effects:
        for name, value in increments(effect.key, effect.values).items():
            off[name] += value / DECLARED[name]
        if effect.key == "cg_shift":
            for name in ("alpha", "q", "de"):
                off[f"Cm{name}"] += effect.values["dx_mac"] * DECLARED[f"CL{name}"] / DECLARED[f"Cm{name}"]
    parts = combined(effects)
    for name in _NAMES:
        elevator = parts.elevator if name.endswith("de") else 1.0
        factor = elevator / (parts.mass if name.startswith("CL") else parts.inertia)
        off[name] = factor * (1.0 + off[name]) - 1.0
    x = np.zeros(_PRIOR + _FREE)
    x[: len(_NAMES)] = [off[name] / DERIVATIVES[name][1] for name in _NAMES]
    return x


def together(trial: Trial, whiten: Whitener, along: Directions) -> float:
    """Noncentrality of all effects of a trial, against its aircraft without any."""
    parts = combined(trial.effects)
    gap = at_body(trial, trial.body, parts) - at_body(trial, trial.body, Parts())
    value = along.projection.rest(whiten(gap).ravel())
    if value < _LARGE or np.abs(trimmed_alike(trial, Parts(), parts)).max() > _ALIKE:
        return min(value, _refitted(trial, Parts(), parts, whiten, imitation(trial.effects)))
    return value


def refit_needed(trial: Trial, effect: Added, others: Sequence[Added], first_order: float) -> bool:
    """Whether a noncentrality to first order may mislead."""
    if effect.key == "airspeed_scale" or first_order < _SMALL:
        return False
    if _MEDIUM < first_order < _LARGE:
        return True
    beside = combined(others)
    moved = trimmed_alike(trial, beside, beside + combined((effect,)))
    return bool(np.abs(moved).max() > _ALIKE)


def body_at(body: Body, x: Sequence[float]) -> Body:
    """A body moved by x standard deviations of each derivative, of mass, inertia and CG."""
    errors = {
        name: body.derivatives.get(name, 0.0) + std * part
        for (name, (_, std)), part in zip(DERIVATIVES.items(), x, strict=False)
    }
    mass, inertia, cg = x[len(_NAMES) : _PRIOR]
    return replace(
        body,
        derivatives=errors,
        mass=body.mass + BODY["mass"] * mass,
        inertia=body.inertia + BODY["inertia"] * inertia,
        cg=body.cg + BODY["cg"] * cg,
    )


def at_body(trial: Trial, body: Body, parts: Parts) -> Array:
    """`flown` of the trial's aircraft with another body."""
    return flown(trial, Truth(model(body, parts), COARSE_S), parts)


def refitted(trial: Trial, effect: Added, others: Sequence[Added], whiten: Whitener) -> float:
    """Twice the log-likelihood by which a truth with the effect stays ahead of one without, all else refitted.

    Free are, of each record, biases and initial state; of all, constants in CL and Cm; derivatives, mass,
    inertia and CG have their declared uncertainty as prior about the trial's own.
    """
    beside = combined(others)
    return _refitted(trial, beside, beside + combined((effect,)), whiten)


def _refitted(
    trial: Trial, beside: Parts, parts: Parts, whiten: Whitener, start: Array | None = None
) -> float:
    """`refitted` of parts; from ``start`` with the trim of the target, if there is one."""
    target = whiten(at_body(trial, trial.body, parts))
    free = own_directions(trial, whiten, target.shape[0], target.shape[1] + len(whiten.coefficients))
    basis = np.linalg.qr(free / np.linalg.norm(free, axis=0))[0]

    def left(x: Array) -> Array:
        shifted = beside + constants(x[_PRIOR:])
        gap = (target - whiten(at_body(trial, body_at(trial.body, x.tolist()), shifted))).ravel()
        return np.concatenate([gap - basis @ (basis.T @ gap), x[:_PRIOR]])

    starts = [np.zeros(_PRIOR + _FREE)]
    alike = trimmed_alike(trial, beside, parts)
    if start is not None:
        starts = [start + np.concatenate([starts[0][:_PRIOR], alike])]
    elif np.abs(alike).max() > _ALIKE:
        starts.append(np.concatenate([starts[0][:_PRIOR], alike]))
    return min(_least(left, start) for start in starts)


def constants(x: Array) -> Parts:
    """Constants in CL and Cm, in units of `TRIMS`."""
    return Parts(
        shapes=tuple(
            Shape(t.coefficient, t.shape, t.value * float(part)) for t, part in zip(TRIMS, x, strict=True)
        )
    )


def trimmed_alike(trial: Trial, beside: Parts, parts: Parts) -> Array:
    """Constants (2,) that trim the aircraft where the effect does, so that it flies over the same breaks."""

    def trim(these: Parts) -> Array:
        truth = Truth(model(trial.body, these), COARSE_S)
        return np.array([truth.alpha_rad, truth.elevator_rad])

    aim, x = trim(parts), np.zeros(_FREE)
    for _ in range(_TRIM_ITERATIONS):
        at = trim(beside + constants(x))
        slope = np.column_stack(
            [(trim(beside + constants(x + _STEP * unit)) - at) / _STEP for unit in np.eye(_FREE)]
        )
        x = x + np.linalg.solve(slope, aim - at)
    return x


def _least(left: Callable[[Array], Array], x: Array) -> float:
    """Least square of ``left`` by Gauss-Newton from a start."""
    r = left(x)
    for _ in range(_ITERATIONS):
        slope = np.column_stack([(left(x + _STEP * unit) - r) / _STEP for unit in np.eye(x.size)])
        move = -np.linalg.lstsq(slope, r, rcond=1e-10)[0]
        before = float(r @ r)
        for _ in range(_HALVINGS):
            try:
                tried = left(x + move)
            except (RuntimeError, np.linalg.LinAlgError):  # it cannot be trimmed there
                tried = np.full_like(r, np.inf)
            if tried @ tried < before:
                x, r = x + move, tried
                break
            move = move / 2.0
        if not float(r @ r) < 0.98 * before - 0.05:
            break
    return float(r @ r)
