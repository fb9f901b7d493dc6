"""Evidence of physics on an assignment: logarithms of likelihood ratios, with the figure that each rests on.

A relation y = x between a measured channel and what others require of it is compared with "unrelated, and of any size". Both
sides are divided into blocks, and a polynomial is taken out of each, which stands for biases and the start of an integral. With n
independent samples and the squared correlation R2 a common motion has the logarithm -(n/2) ln(1 - R2). The factor k of y on x has
the variance (1 - R2)/(n R2) + tau^2 of its logarithm, tau the tolerance of the relation; its density at 1 is compared with a
broad one. A wrong unit moves k, a wrong sign makes it negative, a wrong axis takes R2 away.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend
from scipy.special import log_ndtr

from airtruth.channels import SIGNALS
from airtruth.checks.spectra import integral, regress, spectrum
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.motion_parts import Control
from airtruth.units import G0

Array = NDArray[np.float64]

(_SURFACE,) = LONGITUDINAL.controls
BLOCK_S: Final = 8.0
"""Length of a block [s] (judgement: some periods of the short period, shorter than drifts)."""
BAND_HZ: Final = 1.0
"""Band of the motion, which gives the number of independent samples [Hz] (judgement)."""
TOLERANCE, BROAD = 0.2, 2.0
"""Standard deviation of the logarithm of a factor that scales, lags and positions of sensors explain, and of one of which
nothing is known [-] (judgement)."""
MOST: Final = 10.0
"""Largest logarithm of a likelihood ratio that one relation may give [-]: a model is never surer of itself."""


@dataclass(frozen=True)
class SlotFinding:
    """A relation that was tested: logarithm of its likelihood ratio, and the figure in words."""

    log_ratio: float
    words: str


@dataclass(frozen=True)
class SlotRelation:
    """Slots that a relation needs and is evidence for, its test, and slots that it uses where they are filled."""

    needs: tuple[str, ...]
    test: Callable[[Mapping[str, Array], float], SlotFinding]
    uses: tuple[str, ...] = ()


@cache
def _basis(samples: int, degree: int) -> Array:
    """Orthonormal polynomials up to a degree (samples, degree + 1)."""
    return np.asarray(np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, samples), degree + 1))[0])


def _rest(x: Array, dt_s: float, degree: int) -> Array:
    length = max(degree + 3, min(len(x), round(BLOCK_S / dt_s)))
    count = max(1, len(x) // length)
    blocks = x[: count * length].reshape(count, -1)
    basis = _basis(blocks.shape[1], degree)
    return np.asarray(blocks - (blocks @ basis) @ basis.T)


def compared(y: Array, x: Array, dt_s: float, degree: int) -> tuple[float, float, float]:
    """Logarithm of the likelihood ratio of y = x, factor of y on x, and squared correlation."""
    with np.errstate(all="ignore"):
        a, b = _rest(y, dt_s, degree), _rest(x, dt_s, degree)
        own, given, product = (a**2).sum(), (b**2).sum(), (a * b).sum()
        samples = 2.0 * BAND_HZ * dt_s * a.size
        share = min(product**2 / max(own * given, 1e-300), 1.0)
        factor = product / max(given, 1e-300)
    if not np.isfinite([share, factor]).all() or samples * share < 9.0:
        return 0.0, float(factor) if np.isfinite(factor) else np.nan, 0.0
    if factor < 0.0:
        return -MOST, float(factor), float(share)
    common = min(-0.5 * samples * np.log(max(1.0 - share, 1e-9)), 0.5 * MOST)
    std = np.hypot(np.sqrt((1.0 - share) / (samples * share)), TOLERANCE)
    return float(common + _density(float(np.log(factor)), float(std), BROAD)), float(factor), float(share)


def _density(deviation: float, std: float, broad: float) -> float:
    """Logarithm of a normal density of a deviation over that of a broad one that knows nothing."""
    square = deviation * deviation  # ** would raise where it overflows
    ratio = 0.5 * square * (broad**-2 - std**-2) + np.log(broad / std)
    return float(np.clip(ratio, -MOST, MOST))


def moved(
    name: str, words: str, degree: int, y: Callable[..., Array], x: Callable[..., Array]
) -> Callable[..., SlotFinding]:
    def test(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
        ratio, factor, share = compared(y(c), x(c, dt_s), dt_s, degree)
        return SlotFinding(ratio, f"{name} is {factor:.3g} of {words} (R2 {share:.2f})")

    return test


def near(deviation: float, std: float, broad: float, words: str) -> SlotFinding:
    return SlotFinding(_density(deviation, std, broad) if np.isfinite(deviation) else 0.0, words)


def _attitude(c: Mapping[str, Array], dt_s: float) -> Array:
    if "theta" in c:
        return c["theta"]
    turned = integral(c["q"], dt_s)
    return np.asarray(turned - turned.mean() + c["alpha"].mean())


def _heave(c: Mapping[str, Array], dt_s: float) -> Array:
    theta, alpha, ax = _attitude(c, dt_s), c["alpha"], c.get("ax", 0.0)
    force = c["az"] * np.cos(alpha) - ax * np.sin(alpha) + G0 * np.cos(theta - alpha)
    return integral(c["q"] + force / np.maximum(np.abs(c["airspeed"]), 1.0), dt_s)


def _along(c: Mapping[str, Array], dt_s: float) -> Array:
    alpha = incidence(c, dt_s)
    pull = c["ax"] * np.cos(alpha) + c["az"] * np.sin(alpha) - G0 * np.sin(c["theta"] - alpha)
    return integral(pull, dt_s)


def incidence(c: Mapping[str, Array], dt_s: float) -> Array:
    """Angle of attack: measured, or but for a line the integral of q + (az + g)/V about theta, or theta [rad]."""
    if "alpha" in c:
        return c["alpha"]
    theta = c["theta"] if "theta" in c else np.zeros_like(c["q"])
    if "airspeed" not in c:
        return theta
    turned = integral(c["q"] + (c["az"] + G0) / np.maximum(np.abs(c["airspeed"]), 1.0), dt_s)
    return np.asarray(detrend(turned) + theta.mean())


def _risen(c: Mapping[str, Array], dt_s: float) -> Array:
    up = -c["az"] * np.cos(c["theta"]) - G0
    if "ax" in c:
        up = up + c["ax"] * np.sin(c["theta"])
    return integral(integral(up, dt_s), dt_s)


def _climbed(c: Mapping[str, Array], dt_s: float) -> Array:
    return integral(c["airspeed"] * np.sin(c["theta"] - c["alpha"]), dt_s)


def _weight(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    mean = float(np.median(c["az"]))
    return near(mean / G0 + 1.0, 0.12, 2.0, f"the median of az is {mean / G0:.2f} g")


def _axial(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    off = float(np.median(c["ax"] - G0 * np.sin(np.clip(c["theta"], -1.5, 1.5)))) / G0
    return near(off, 0.05, 0.5, f"the median of ax departs by {off:+.3f} g from g sin(theta)")


def _level(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    off = float(np.median(c["theta"] - c["alpha"]))
    return near(off, 0.12, 1.0, f"the median of theta - alpha is {np.degrees(off):.1f} deg")


def control(c: Mapping[str, Array], dt_s: float) -> tuple[float, float]:
    """Change of q' with the surface, with q and alpha held, and its standard deviation [1/s2]."""
    return effect(c["q"], [c[_SURFACE.name], incidence(c, dt_s), c["q"]], dt_s)


def effect(rate: Array, causes: Sequence[Array], dt_s: float) -> tuple[float, float]:
    """Change of the derivative of a rate with the first cause, the others held, and its standard deviation."""
    with np.errstate(all="ignore"):
        factors = regress(
            spectrum(rate[None], dt_s),
            np.stack([spectrum(integral(x, dt_s)[None], dt_s) for x in causes], axis=1),
        )
        return float(factors.value[0, 0]), float(np.sqrt(factors.covariance[0, 0, 0]))


def _pitches(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    return moves(*control(c, dt_s), 15.0, changes(_SURFACE))


def changes(control: Control) -> str:
    """Effect of a surface on the rate that it controls, in words."""
    return f"the {control.name} changes {SIGNALS[control.damped].stem}'"


def moves(value: float, std: float, usual: float, words: str) -> SlotFinding:
    """Evidence of an effect of a surface that has to be negative.

    The two signs differ by the logarithm of the odds of a negative effect, half of which counts for each.

    Parameters
    ----------
    value, std : effect and its standard deviation [1/s2]; usual : size of that of an aircraft [1/s2].
    """
    if not (np.isfinite(value) and std > 0.0):
        return SlotFinding(0.0, "it does not move")
    t = value / std
    signed = float(np.clip(0.5 * (log_ndtr(-t) - log_ndtr(t)), -0.5 * MOST, 0.5 * MOST))
    size = (
        float(np.clip(-0.5 * (np.log(max(abs(value), 1e-9) / usual) / 1.5) ** 2, -MOST, 0.0))
        if abs(t) > 3
        else 0.0
    )
    return SlotFinding(signed + size, f"{words} by {value:+.3g} +- {std:.2g} 1/s2")


def _lifts(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    """Lift follows alpha = theta - gamma, gamma the integral of the load over V: az = -a (theta + integral(az + g)/V)."""
    theta, load = c["theta"] if "theta" in c else integral(c["q"], dt_s), c["az"] + G0
    causes = [theta, integral(load, dt_s), *(c[name] for name in (_SURFACE.name,) if name in c)]
    with np.errstate(all="ignore"):
        factors = regress(
            spectrum(load[None], dt_s), np.stack([spectrum(x[None], dt_s) for x in causes], axis=1)
        )
        value, covariance = factors.value[0], factors.covariance[0]
        slope, speed = -value[0], value[0] / value[1]
        variance = (
            covariance[0, 0] / value[0] ** 2
            + covariance[1, 1] / value[1] ** 2
            - 2 * covariance[0, 1] / value[0] / value[1]
        )
        std = float(np.sqrt(max(variance, 0.0) + 0.2**2))
    if not (np.isfinite([slope, speed, std]).all() and slope > 0.0 and speed > 0.0 and std < 0.6):
        return SlotFinding(0.0, "the lift does not show it")
    off = float(np.log(max(float(np.mean(c["airspeed"])), 1e-3) / speed))
    return near(off, std, 2.0, f"the airspeed is {np.exp(off):.2f} of that which lift and pitch rate require")


def _ground(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    ratio = float(np.median(c["airspeed"])) / max(float(np.median(c["ground_speed"])), 1e-3)
    return near(
        float(np.log(max(ratio, 1e-6))), 0.3, 2.0, f"the airspeed is {ratio:.2f} of the speed over ground"
    )


def _air(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    standard = density_kg_m3(np.clip(np.median(c["altitude"]), -500.0, 20000.0))
    ratio = float(np.median(c["density"]) / standard)
    return near(
        float(np.log(max(ratio, 1e-6))),
        0.05,
        2.0,
        f"the density is {ratio:.3f} of the standard atmosphere's there",
    )


def _pressure_height(c: Mapping[str, Array], dt_s: float) -> SlotFinding:
    off = float(np.median(c["altitude"] - c["gps_altitude"]))
    return near(off / 250.0, 1.0, 40.0, f"the altitude is {off:+.0f} m from the satellites' altitude")


_TURNED = moved("theta", "the integral of q", 2, lambda c: c["theta"], lambda c, dt: integral(c["q"], dt))
_HEAVED = moved("alpha", "the integral of q + (az + g)/V", 2, lambda c: c["alpha"], _heave)
_DRAWN = moved("the airspeed", "the integral of the force along the path", 2, lambda c: c["airspeed"], _along)
_LIFTED = moved(
    "the altitude", "the double integral of the vertical force", 3, lambda c: c["altitude"], _risen
)
_FLOWN = moved("the altitude", "the integral of V sin(theta - alpha)", 2, lambda c: c["altitude"], _climbed)
RELATIONS: Final = (
    SlotRelation(("az",), _weight),
    SlotRelation(("theta", "q"), _TURNED),
    SlotRelation(("ax", "theta"), _axial),
    SlotRelation(("alpha", "theta"), _level),
    SlotRelation(("alpha", "q", "az", "airspeed"), _HEAVED, ("theta", "ax")),
    SlotRelation(("airspeed", "theta", "q", "az", "ax"), _DRAWN, ("alpha",)),
    SlotRelation(("airspeed", "az", "q"), _lifts, ("theta", _SURFACE.name)),
    SlotRelation(("altitude", "theta", "az"), _LIFTED, ("ax",)),
    SlotRelation(("altitude", "theta", "alpha", "airspeed"), _FLOWN),
    SlotRelation((_SURFACE.name, "q", "az"), _pitches, ("alpha", "airspeed", "theta")),
    SlotRelation(("airspeed", "ground_speed"), _ground),
    SlotRelation(("density", "altitude"), _air),
    SlotRelation(("altitude", "gps_altitude"), _pressure_height),
)
"""Everything that is tested. A relation uses further slots where they are assigned."""

__all__ = [
    "MOST",
    "RELATIONS",
    "SlotFinding",
    "SlotRelation",
    "changes",
    "compared",
    "control",
    "effect",
    "moved",
    "moves",
    "near",
]
