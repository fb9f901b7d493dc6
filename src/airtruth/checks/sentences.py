"""Sentences for failed tests: the evidence with its figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from airtruth.channels import SIGNALS
from airtruth.checks.means import LIMITS, MEANS
from airtruth.checks.relation import Relation
from airtruth.physics.motion import LATERAL, LONGITUDINAL

TURNS: Final = dict(zip((control.name for control in LATERAL.controls), ("rolls", "yaws"), strict=True))
"""Control -> what it does to an aircraft."""
STEADY: Final = dict(
    zip(
        (f"{control.name}_size" for control in LATERAL.controls),
        (("roll rate", " 1/s", "3 to 15"), ("sideslip", "", "0.4 to 1.6")),
        strict=True,
    )
)
"""Test of the size of a control -> steady motion that it causes, its unit and the usual range (judgement)."""
SHOWN: Final = 3
"""Number of runs that a sentence names."""
PASSED: Final = 4.0
"""Squared distance below which a test passes: two standard deviations."""
FAILED: Final = 50.0
"""Squared distance above which a test has failed as clearly as it can."""


def left_out(run_ids: Sequence[str], count: int, rest: int, reason: str) -> str:
    """State that runs of ``count`` were left out and that the other ``rest`` are used, with the reason."""
    return f"left out {runs(run_ids, count)}, the other {rest} are used: {reason}"


def evidence(test: Relation, row: int = -1) -> str:
    """The measured and the required value of a test, for one run, or with -1 for all together."""
    f = [float(x) for x in test.figures[row]]
    name = test.channels[0]
    if test.name == "range":
        unit = SIGNALS[name].unit
        low, high = MEANS.get(name, LIMITS[name])
        return f"{name} reaches {f[0]:.4g} to {f[2]:.4g} {unit}, outside {low:.3g} to {high:.3g} {unit}"
    if test.name == "air":
        return (
            f"density_kg_m3 averages {f[0]:.3g} kg/m3, where the standard atmosphere has {f[2]:.3g} kg/m3 at the "
            f"altitude_m of {f[1]:.5g} m"
        )
    if test.name in ("az_mean", "ax_mean", "ay_mean"):
        return f"{name} averages {f[0]:.3g} m/s2, where gravity and the path require {f[1]:.3g} +- {f[2]:.2g} m/s2"
    if test.name == "theta":
        return (
            f"theta_rad changes by {f[0]:.3g} +- {f[1]:.2g} of the integral of {name} (squared correlation "
            f"{f[2]:.2f}), where 1 is required"
        )
    if test.name == "alpha":
        return (
            f"{name} changes by {f[0]:.3g} +- {f[2]:.2g} of the integral of {test.channels[3]} and by {f[1]:.3g} +- {f[3]:.2g} "
            "of that of (az + g cos(gamma))/V, where 1 and 1 are required"
        )
    if test.name in ("phi", "psi"):
        rate = test.channels[0]
        return (
            f"{test.channels[1]} changes by {f[0]:.3g} +- {f[1]:.2g} of the integral of {rate} and its coupling (squared "
            f"correlation {f[2]:.2f}), where 1 is required"
        )
    if test.name == "beta":
        return f"the rate of {LATERAL.vane} is {_shares(f)}, where 1 is required of each"
    if test.name == "side_slope":
        side = LATERAL.outputs[-1].channel
        held, unless = (
            ("with the yaw acceleration held, ", "")
            if f[3] > 0.0
            else ("", ", unless the accelerometer is far ahead of the CG")
        )
        return (
            f"{held}{side} changes by {-f[0]:.2g} +- {f[1]:.2g} g per radian of {LATERAL.vane}, where sideslip from the right "
            f"pushes to the left, usually by about {f[2]:.2g} g{unless}"
        )
    if test.name in TURNS:
        return (
            f"with the other causes held, {name} changes the rate of {test.channels[1]} by {f[0]:+.3g} +- {f[1]:.2g} 1/s2, where "
            f"a positive {test.name} {TURNS[test.name]} to the left"
        )
    if test.name in STEADY:
        quantity, unit, usual = STEADY[test.name]
        return f"the steady {quantity} is {f[0]:.3g}{unit} of {name}, where {usual}{unit} is usual"
    if test.name == LONGITUDINAL.controls[0].name:
        return (
            f"with alpha and q held, {name} changes q' by {f[0]:+.3g} +- {f[1]:.2g} 1/s2, where a trailing edge "
            "down (positive) pitches the nose down"
        )
    if test.name == "ax_slope":
        return f"ax_m_s2 changes by {f[0]:.2g} +- {f[1]:.2g} g per radian of {LONGITUDINAL.vane}, where about 1 g is usual"
    if test.name == "command":
        return (
            f"{test.channels[1]} follows {f[0]:.3g} +- {f[1]:.2g} of {name} after {1e3 * f[2]:+.0f} "
            f"+- {1e3 * f[3]:.0f} ms, where a positive factor and a delay are required"
        )
    return f"the records give {test.name} = {f[0]:.3g} +- {f[1]:.2g}, where about {f[2]:.3g} is expected"


SHARES: Final = (
    ("of the sum of turn, gravity by bank and ay/V",),
    ("of p sin(alpha) - r cos(alpha)", "of gravity by bank and ay/V"),
    ("of p sin(alpha) - r cos(alpha)", "of gravity by bank", "of ay/V"),
)
"""Causes of the rate of beta, by the number that were told apart."""


def _shares(f: Sequence[float]) -> str:
    """Factors of the rate of beta, of as many causes as were told apart."""
    causes = SHARES[sum(map(math.isfinite, f[:3])) - 1]
    return " and ".join(f"{f[i]:.3g} +- {f[3 + i]:.2g} {words}" for i, words in enumerate(causes))


def runs(run_ids: Sequence[str], total: int) -> str:
    """ "all 6 runs", "run 'a'" or "2 of 6 runs ('a', 'b')"."""
    if len(run_ids) == total:
        return f"all {total} runs" if total > 1 else f"run {run_ids[0]!r}"
    shown = ", ".join(map(repr, run_ids[:SHOWN])) + (", ..." if len(run_ids) > SHOWN else "")
    return f"{len(run_ids)} of {total} runs ({shown})"


def culprit(results: Sequence[Relation], one: str, other: str) -> str:
    """Which of two equal channels is wrong: the tests without the wrong one pass, those with it fail."""

    def innocence(name: str) -> float:
        elsewhere = sum(min(np.max(t.distance), FAILED) for t in results if name not in t.channels)
        passed = sum(bool(np.max(t.distance) < PASSED) for t in results if name in t.channels)
        return float(elsewhere + PASSED * passed)

    return min((one, other), key=innocence)


__all__ = ["culprit", "evidence", "runs"]
