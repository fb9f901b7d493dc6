"""Corrections: what each known mistake of a log would be undone by, and the best explanation of failed tests.

A log that fails its tests is corrected for each known mistake in turn and tested once more. The sum of the
squared distances is minus twice a log likelihood, so its decrease is the likelihood ratio of "this mistake was
made" against "none was". A mistake is certain if it explains nearly everything that failed; a log that no
mistake explains (a gust, a turn, an unstable aircraft) is not refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import SIGNALS
from airtruth.checks.evidence import relations
from airtruth.checks.relation import ATMOSPHERE_M, Relation
from airtruth.logs.flight_log import Batch
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.units import DEG, FT, G0, KT, SLUG

Array = NDArray[np.float64]
Channels = Mapping[str, Array]

SUSPECT: Final = 9.0
"""Sum of squared distances above which corrections are tried; the clean logs of the tests are mostly below it."""
GAIN: Final = 7.0
"""Least decrease of the sum for a certain mistake: a likelihood ratio of exp(3.5)."""
REST: Final = 0.4
"""Largest share of the sum that a certain mistake may leave."""
PARTIAL: Final = 6.0
"""Decrease of the sum beyond `GAIN` that a mistake in a part of the runs has to bring: a likelihood ratio of exp(3).

Columns are mapped once for all runs of a log (judgement), and gusts shift the estimates of a single run.
"""
AERODYNAMIC: Final = ("elevator", "ax_slope")
"""Tests that take alpha and q as right; the others are kinematic."""
MOST_RUNS: Final = 12
"""Runs that are tested with each correction; more would cost time and add no certainty."""
MOST_FAULTS: Final = 4
"""Mistakes that are looked for in one log, one after another."""


@dataclass(frozen=True)
class Correction:
    """The inverse of a mistake.

    Attributes
    ----------
    channels : channels that it changes, the one to name first.
    code : kind of fault, see `airtruth.checks.fault.CODES`.
    mistake : the mistake in words.
    cure : what to write in the import mapping.
    apply : channels (runs, samples) -> those that change.
    sensor : whether it is an error of a sensor and none of the mapping; such an error never refuses a log.
    penalty : what it adds to the sum: minus twice the logarithm of how often the mistake is made,
        relative to a wrong sign (judgement).
    """

    channels: tuple[str, ...]
    code: str
    mistake: str
    cure: str
    apply: Callable[[Channels], Channels]
    penalty: float = 0.0
    sensor: bool = False


def _scaled(name: str, factor: float) -> Callable[[Channels], Channels]:
    return lambda c: {name: factor * c[name]}


def _setting(name: str, unit: str = "", sign: bool = False) -> str:
    parts = [f'unit = "{unit}"'] if unit else []
    parts += ["sign = -1"] if sign else []
    return f"state {' and '.join(parts)} under [channels.{name}] in the import mapping"


def _unit_corrections(name: str, units: Mapping[str, tuple[float, str]]) -> Iterator[Correction]:
    """The other sign, each other unit, and both."""
    yield Correction((name,), "sign", "opposite sign", _setting(name, sign=True), _scaled(name, -1.0))
    for unit, (factor, mistake) in units.items():
        cure = _setting(name, unit)
        yield Correction((name,), "unit", mistake, cure, _scaled(name, factor), 1.0)
        both = f"{mistake} and opposite sign"
        cure = _setting(name, unit, sign=True)
        yield Correction((name,), "unit_and_sign", both, cure, _scaled(name, -factor), 2.0)


_ANGLE: Final = {"deg": (DEG, "degrees taken as radians"), "rad": (1.0 / DEG, "radians taken as degrees")}
"""Unit to state in a mapping -> factor that undoes the mistake [-], and the mistake, for angles."""
_RATE: Final = {"deg_s": _ANGLE["deg"], "rad_s": _ANGLE["rad"]}
"""The same for angular rates."""
_FORCE: Final = {
    "g": (G0, "g taken as m/s2"),
    "ft_s2": (FT, "ft/s2 taken as m/s2"),
    "m_s2": (1.0 / G0, "m/s2 taken as g"),
}
"""The same for specific forces."""
_FEET_OR_KM_H: Final = 0.5 * (FT + 1.0 / 3.6)
"""Mean of ft/s and km/h in m/s [-]: the two differ by 10 %, less than a log can tell."""
_SPEED: Final = {
    "kt": (KT, "knots taken as m/s"),
    'ft_s" or "km_h': (_FEET_OR_KM_H, "ft/s or km/h taken as m/s"),
    "m_s": (1.0 / KT, "m/s taken as knots"),
    'm_s" (no longer "ft_s" or "km_h")': (1.0 / _FEET_OR_KM_H, "m/s taken as ft/s or km/h"),
}
"""The same as `_ANGLE` for airspeeds."""
_SCALES: Final = (0.1, 0.2, 0.5, 2.0, 5.0, 10.0)
"""Factors by which an airspeed or density of no known unit may be wrong [-]."""


def _gravity(c: Channels, name: str) -> Array:
    """Share of gravity in an accelerometer that an acceleration without gravity lacks [m/s2]."""
    theta = c.get("theta_rad", np.zeros_like(c[name]))
    return -G0 * np.cos(theta) if name == "az_m_s2" else G0 * np.sin(theta)


def _gravity_corrections(name: str) -> Iterator[Correction]:
    missing = "no gravity"
    cure = f"map the specific force that an accelerometer feels, gravity included, to {name}"
    yield Correction((name,), "gravity", missing, cure, lambda c: {name: c[name] + _gravity(c, name)}, 1.0)
    yield Correction(
        (name,),
        "gravity",
        f"{missing} and opposite sign",
        cure,
        lambda c: {name: -c[name] + _gravity(c, name)},
        2.0,
    )
    yield Correction(
        (name,),
        "gravity",
        f"{missing} and g taken as m/s2",
        cure,
        lambda c: {name: G0 * c[name] + _gravity(c, name)},
        2.0,
    )
    yield Correction(
        (name,), "gravity", "gravity twice", cure, lambda c: {name: c[name] - _gravity(c, name)}, 1.0
    )


RIVAL: Final = 2.0
"""Difference of two sums below which both mistakes are named: a likelihood ratio of e."""
LAGS_S: Final = (0.1, 0.2, 0.3, 0.5, 0.8)
"""Lags of an alpha vane that are tried [s] (judgement: pneumatic probes of transports have half a second)."""
_STATE_OF_FLIGHT: Final = frozenset({"airspeed_m_s", "altitude_m", "density_kg_m3", "throttle"})
"""Channels that hardly change within a record. One of them is not exchanged by mistake with one that follows the motion:
such an exchange fits only because it makes the physical relations uninformative."""


def _swaps(names: tuple[str, ...]) -> Iterator[Correction]:
    for one, other in combinations(names, 2):
        if (one in _STATE_OF_FLIGHT) != (other in _STATE_OF_FLIGHT):
            continue
        yield Correction(
            (one, other),
            "swapped",
            f"swapped with {other}",
            f"exchange the columns of {one} and {other} in the import mapping",
            lambda c, one=one, other=other: {one: c[other], other: c[one]},  # type: ignore[misc]
            3.0,
        )


def _air_corrections(names: tuple[str, ...]) -> Iterator[Correction]:
    if "altitude_m" in names:
        for unit, factor, mistake in (("ft", FT, "feet taken as metres"), ("km", 1e3, "km taken as metres")):
            cure = _setting("altitude_m", unit)
            yield Correction(("altitude_m",), "unit", mistake, cure, _scaled("altitude_m", factor), 1.0)
    if "density_kg_m3" in names:
        name = "density_kg_m3"
        cure = _setting(name, "slug_ft3")
        slug = SLUG / FT**3
        yield Correction((name,), "unit", "slug/ft3 taken as kg/m3", cure, _scaled(name, slug), 1.0)
        if "altitude_m" in names:
            yield Correction(
                (name,),
                "scale",
                "unknown factor",
                f"state the unit of {name}, or leave it out: altitude_m is enough",
                lambda c: {name: _standard(c) + 0.0 * c[name]},
                4.0,
            )


def _standard(c: Channels) -> Array:
    return np.asarray(density_kg_m3(np.clip(c["altitude_m"], *ATMOSPHERE_M)))


def _lags(names: tuple[str, ...], dt_s: float) -> Iterator[Correction]:
    """Lags of a slow vane: without them its weak response passes for a wrong airspeed."""
    if "alpha_rad" not in names:
        return
    for lag in LAGS_S:
        yield Correction(
            ("alpha_rad",),
            "lag",
            f"about {lag:g} s late",
            "`airtruth check` measures the lag; declare it under [sensors] of the aircraft",
            lambda c, lag=lag: {  # type: ignore[misc]
                "alpha_rad": c["alpha_rad"] + lag * np.gradient(c["alpha_rad"], dt_s, axis=1)
            },
            2.0,
            True,
        )


def catalogue(names: tuple[str, ...], dt_s: float) -> list[Correction]:
    """Every known mistake in a log of these channels and this sample period [s], and lags of its vane."""
    result: list[Correction] = []
    for name in names:
        dimension = SIGNALS[name].dimension
        if dimension == "angle":
            result += _unit_corrections(name, _ANGLE)
        elif dimension == "angular_rate":
            result += _unit_corrections(name, _RATE)
        elif dimension == "acceleration":
            result += [*_unit_corrections(name, _FORCE), *_gravity_corrections(name)]
    name = "airspeed_m_s"
    if name in names:
        for unit, (factor, mistake) in _SPEED.items():
            cure = _setting(name, unit)
            result.append(Correction((name,), "unit", mistake, cure, _scaled(name, factor), 1.0))
        for factor in _SCALES:
            mistake, cure = (
                f"factor of about {1.0 / factor:g}",
                f"state the unit and scale of {name} in the import mapping",
            )
            result.append(Correction((name,), "scale", mistake, cure, _scaled(name, factor), 2.0))
    if "throttle" in names:
        cure = _setting("throttle", "pct")
        scaled = _scaled("throttle", 0.01)
        result.append(Correction(("throttle",), "unit", "per cent taken as a share", cure, scaled, 1.0))
    return [*result, *_air_corrections(names), *_swaps(names), *_lags(names, dt_s)]


@dataclass(frozen=True)
class Explanation:
    """A mistake that explains failed tests.

    Attributes
    ----------
    correction : its inverse; None if no known mistake explains them.
    failed : the test that failed most.
    gain : decrease of the sum of squared distances.
    certain : whether hardly anything is left, see `GAIN` and `REST`.
    rival : the inverse of another mistake that explains the tests nearly as well, see `RIVAL`.
    """

    correction: Correction | None
    failed: Relation
    gain: float
    certain: bool
    rival: Correction | None = None

    @property
    def mistake(self) -> str:
        """The mistake in words, and its rival."""
        if self.correction is None or self.rival is None:
            return "" if self.correction is None else self.correction.mistake
        same = self.rival.channels == self.correction.channels
        other = self.rival.mistake if same else f"{self.rival.channels[0]}: {self.rival.mistake}"
        return f"{self.correction.mistake}, or {other}"

    @property
    def cure(self) -> str:
        """What to write in the mapping, for either."""
        words = [one.cure for one in (self.correction, self.rival) if one is not None]
        return "; or ".join(words)


def total(results: list[Relation], before: list[Relation] | None = None) -> float:
    """Sum of the squared distances of all runs together.

    With ``before``, a test that a correction leaves without information counts as before the correction: to
    hide the evidence is no explanation.
    """
    own = {t.name: t for t in before or () if t.name != "range"}
    return float(
        sum(
            max(t.distance[-1], own[t.name].distance[-1])
            if t.name in own and not t.informed
            else t.distance[-1]
            for t in results
        )
    )


def explain(batch: Batch, aircraft: Aircraft | None = None, *, partial: bool = False) -> list[Explanation]:
    """Mistakes that were made in a batch, the clearest first; empty if its tests pass.

    Parameters
    ----------
    partial : whether the batch is a part of the runs of a log, see `PARTIAL`.
    """
    batch = _first(batch, MOST_RUNS)
    least = GAIN + (PARTIAL if partial else 0.0)
    results = relations(batch, aircraft)
    now = total(results)
    found: list[Explanation] = []
    while now > SUSPECT and len(found) < MOST_FAULTS:
        names = tuple(n for n in batch.channels if n in SIGNALS)
        used = {n for e in found if e.correction for n in e.correction.channels}
        best: tuple[float, Correction, Batch, list[Relation]] | None = None
        values: list[tuple[float, Correction]] = []
        for correction in catalogue(names, batch.dt_s):
            if used & set(correction.channels):
                continue
            changed = replace(batch, channels={**batch.channels, **correction.apply(batch.channels)})
            after = relations(changed, aircraft)
            value = total(after, results) + correction.penalty
            values.append((value, correction))
            if best is None or value < best[0]:
                best = value, correction, changed, after
        failed = _first_failed(results)
        if best is None or now - best[0] < least:
            found.append(Explanation(None, failed, 0.0, False))
            break
        helped = max(results, key=lambda t: _decrease(t, best[3]))
        found.append(Explanation(best[1], helped, now - best[0], False, _rival(best[1], best[0], values)))
        batch, results, now = best[2], best[3], best[0] - best[1].penalty
    explained = sum(e.gain for e in found)
    certain = now < max(SUSPECT, REST * explained)
    return [
        replace(e, certain=certain and e.correction is not None and not e.correction.sensor) for e in found
    ]


def _rival(best: Correction, value: float, values: list[tuple[float, Correction]]) -> Correction | None:
    """Another mistake that fits about as well: another unit or gravity of the channel, or a mistake beside a late sensor."""
    kinds = {"unit", "gravity"}
    near = [
        (v, one)
        for v, one in values
        if v - value < RIVAL
        and (
            (one.channels == best.channels and {one.code, best.code} == kinds)
            or (best.sensor and not one.sensor)
        )
    ]
    return min(near, key=lambda pair: pair[0])[1] if near else None


def _first_failed(results: list[Relation]) -> Relation:
    """The test that fails most; a test of the elevator's effect holds alpha and q, so that theirs come first."""
    clear = [t for t in results if t.name not in AERODYNAMIC and t.distance[-1] > GAIN]
    return max(clear or results, key=lambda t: float(t.distance[-1]))


def _decrease(test: Relation, after: list[Relation]) -> float:
    now = sum(
        float(t.distance[-1])
        for t in after
        if t.name == test.name and (t.name != "range" or t.channels == test.channels)
    )
    return float(test.distance[-1]) - now


def _first(batch: Batch, count: int) -> Batch:
    if len(batch.run_ids) <= count:
        return batch
    channels = {name: values[:count] for name, values in batch.channels.items()}
    return replace(batch, run_ids=batch.run_ids[:count], t_s=batch.t_s[:count], channels=channels)


__all__ = ["Correction", "Explanation", "catalogue", "explain", "total"]
