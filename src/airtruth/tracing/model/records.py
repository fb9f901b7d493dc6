"""Measured records for the filter: outputs at the samples, inputs on a fine grid."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.checks.airspeed import WalkInNoise
from airtruth.physics.motion import LATERAL, LONGITUDINAL, Motion
from airtruth.tracing.model.plant import Plant

Array = NDArray[np.float64]

FINE: Final = 8
"""Cells of the surface's own grid per cell of the filter's."""
_HEAD_S: Final = 0.1
"""Start of a record whose mean is its trim with the linear model [s] (judgement: before the manoeuvre moves it)."""
_HEAD_SAMPLES: Final = 3
"""Least number of samples of that start [-] (judgement)."""

OF_OTHER_MOTION: Final = tuple(name for name in LATERAL.known if name not in LONGITUDINAL.known)
"""Channels of the pitch plane that are known inputs of the other motion."""
_SERIES: Final = (
    "controls_rad",
    "airspeed_m_s",
    "ground_m_s",
    "density_kg_m3",
    "theta_rad",
    *OF_OTHER_MOTION,
    "coupling",
    "corner_rad2",
    "surface_noise_rad2",
)
"""Attributes of `Signals` beside the outputs that are series in time, along their last axis."""


def head_samples(dt_s: float) -> int:
    """Samples at the start of a record whose mean is its trim with the linear model; ``dt_s`` is the sample period [s]."""
    return max(_HEAD_SAMPLES, int(_HEAD_S / dt_s))


@dataclass(frozen=True)
class Signals:
    """One run of a log, before any model.

    Attributes
    ----------
    run_id : name of the run.
    dt_s : sample period [s].
    sub : cells of the filter's grid per sample, two per step of integration.
    y : (samples, outputs) [units of the outputs]; one that no instrument measured is reconstructed, see `Settings.measured`.
    controls_rad : (controls, fine points) `FINE` cells to a cell of the filter's grid.
    airspeed_m_s, ground_m_s, density_kg_m3, theta_rad : (points,) on the filter's grid; ground: speed without the gust.
    altitude_m : mean pressure altitude [m].
    throttle : its mean where it is logged, None elsewhere [0..1].
    motion : the motion whose outputs and controls they are.
    alpha_rad, q_rad_s : (points,) known inputs on the filter's grid [rad], [rad/s]; empty where they are outputs.
    ax_m_s2, az_m_s2 : (points,) specific force along body x and z, likewise [m/s2].
    coupling : (2 + signals, points) parts of alpha' [rad/s] and q' [rad/s2] that the lateral motion causes, then its signals
        [rad], [rad/s]; empty where it causes none.
    control_std_rad : (controls,) standard deviation of the noise that remains in each smoothed control [rad]; 0 behind a
        damper, which turns the surface throughout, so that a play does not rest at the extremes of the noise.
    corner_rad2 : (controls, samples) variance of a control's mean over the cell that ends at each sample, about that of
        ``controls_rad``; empty where the samples show the motion of every control.
    surface_noise_rad2 : (controls, samples) variance of the noise that remains in the controls; empty for none.
    airspeed_walk : statistics of an airspeed that is smoothed; None where a low-pass is enough.
    assumed : known inputs that the log lacks, for which those of a steady flight stand.
    lead : what comes before a part of a run; None for a whole run. The filter starts there.
    part_of : name of the run of which it is a part; empty for a whole run.
    """

    run_id: str
    dt_s: float
    sub: int
    y: Array
    controls_rad: Array
    airspeed_m_s: Array
    ground_m_s: Array
    density_kg_m3: Array
    theta_rad: Array
    altitude_m: float
    throttle: float | None
    motion: Motion = LONGITUDINAL
    alpha_rad: Array = field(default_factory=lambda: np.zeros(0))
    q_rad_s: Array = field(default_factory=lambda: np.zeros(0))
    ax_m_s2: Array = field(default_factory=lambda: np.zeros(0))
    az_m_s2: Array = field(default_factory=lambda: np.zeros(0))
    coupling: Array = field(default_factory=lambda: np.zeros((0, 0)))
    control_std_rad: Array = field(default_factory=lambda: np.zeros(1))
    corner_rad2: Array = field(default_factory=lambda: np.zeros((1, 0)))
    surface_noise_rad2: Array = field(default_factory=lambda: np.zeros((1, 0)))
    airspeed_walk: WalkInNoise | None = None
    assumed: tuple[str, ...] = ()
    lead: Signals | None = None
    part_of: str = ""

    @property
    def sampled_controls_rad(self) -> Array:
        """(controls, samples) controls at the samples [rad]."""
        return self.controls_rad[:, :: self.sub * FINE]

    @property
    def elevator_rad(self) -> Array:
        """(fine points,) the one control of the pitch plane [rad]."""
        return np.asarray(self.controls_rad[0])

    @property
    def attack_rad(self) -> Array:
        """(points,) angle of attack, an output or a known input of the motion, on the filter's grid [rad]."""
        return self.alpha_rad if self.alpha_rad.size else fine(self.y[:, 0], self.sub)

    @property
    def with_lead(self) -> Signals:
        """The part of a run and what comes before it, as one."""
        if self.lead is None:
            return self
        both: dict[str, Any] = {
            name: np.concatenate([getattr(self.lead, name), getattr(self, name)], axis=-1) for name in _SERIES
        }
        return replace(self, lead=None, y=np.concatenate([self.lead.y, self.y]), **both)

    def with_airspeed(self, airspeed_m_s: Array) -> Signals:
        """The run, or part of one with what comes before it, with another airspeed (points of `with_lead`,) [m/s]."""
        if self.lead is None:
            return replace(self, airspeed_m_s=airspeed_m_s)
        first = len(self.lead.airspeed_m_s)
        lead = replace(self.lead, airspeed_m_s=airspeed_m_s[:first])
        return replace(self, lead=lead, airspeed_m_s=airspeed_m_s[first:])

    def part(self, name: str, start: int, first: int, last: int) -> Signals:
        """Samples ``first`` to before ``last``, with those from ``start`` on before them."""
        fine, end = self.sub * FINE, last - 1
        lead = None
        if start < first:
            points, cells = slice(start * self.sub, first * self.sub), slice(start * fine, first * fine)
            lead = self._cut(slice(start, first), points, cells)
        points, cells = slice(first * self.sub, end * self.sub + 1), slice(first * fine, end * fine + 1)
        own = self._cut(slice(first, last), points, cells)
        return replace(own, run_id=f"{self.run_id}, {name}", part_of=self.record, lead=lead)

    @property
    def record(self) -> str:
        """Name of the record, also of a part of one."""
        return self.part_of or self.run_id

    def _cut(self, samples: slice, points: slice, fine: slice) -> Signals:
        own: dict[str, Any] = {name: getattr(self, name)[..., points] for name in _SERIES}
        own["controls_rad"] = self.controls_rad[:, fine]
        for name in ("corner_rad2", "surface_noise_rad2"):
            own[name] = getattr(self, name)[:, samples]
        return replace(self, y=np.ascontiguousarray(self.y[samples]), lead=None, **own)


@dataclass(frozen=True)
class TraceRecord:
    """A run and what is declared at its flight condition.

    Attributes
    ----------
    signals : the run.
    plant : the declared aircraft there.
    gust_length_m : scale length of the gust that the filter estimates there [m].
    remainder : (coefficients, points) on the filter's grid, which the declared JSBSim model has along this record beyond the
        plant's tables (`airtruth.tracing.model.longitudinal.remainder`), from the lead on; None for none.
    """

    signals: Signals
    plant: Plant
    gust_length_m: float
    remainder: Array | None = None

    @property
    def samples(self) -> int:
        """Samples of the run."""
        return int(self.signals.y.shape[0])


def fine(x: Array, sub: int) -> Array:
    """Samples on the filter's grid, linear in between."""
    return np.interp(np.arange((len(x) - 1) * sub + 1) / sub, np.arange(len(x)), x)


def nodes(fine: Array) -> Array:
    """Values on the filter's grid: ends of steps as they are, middles such that Simpson's rule has the area."""
    cells = 2 * FINE
    steps = fine[:-1].reshape(-1, cells)
    ends = np.append(fine[::cells][1:-1], fine[-1]) if fine.size > cells + 1 else fine[-1:]
    start = steps[:, 0]
    area = (steps.sum(axis=1) + 0.5 * (ends - start)) / cells
    out = np.empty(2 * len(steps) + 1)
    out[:-1:2] = start
    out[-1] = fine[-1]
    out[1::2] = (6.0 * area - start - ends) / 4.0
    return out
