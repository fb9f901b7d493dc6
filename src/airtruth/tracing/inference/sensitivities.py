"""Whitened innovations of one record and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.tracing.model.response import Response
from airtruth.tracing.model.response_slopes import ResponseSlopes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_DIVERGED: Final = 1e6
"""Whitened change of an innovation by one step of a difference from which the motion diverges [-] (judgement)."""


@dataclass(frozen=True)
class Sensitivities:
    """Whitened innovations of one record and their derivatives.

    Attributes
    ----------
    r : (samples, outputs) whitened innovations.
    logdet : mean of log|S| over the samples.
    t : (parameters, samples, outputs) derivatives of the whitened innovations at fixed whitener; parameters as in `Layout`.
    w : (parameters, outputs, outputs) whitened derivatives of S.
    white : (outputs, outputs) whitener.
    more : (parameters,) derivatives of the sum of log|S| beyond the steady one, by an uncertain surface; or a zero.
    """

    r: Array
    logdet: float
    t: Array
    w: Array
    white: Array
    more: Array = field(default_factory=lambda: np.zeros(1))


class InnovationDerivatives:
    """Collects derivatives of a response."""

    def __init__(self, base: Response, parameters: int) -> None:
        self.base = base
        self.t = np.zeros((parameters, *base.e.shape))
        self.w = np.zeros((parameters, *base.covariance.shape))
        self.more = np.zeros(parameters)

    def put(self, index: int, moved: Response, h: float) -> None:
        white, base = self.base.white, self.base
        change = (moved.e - base.e) @ white.T
        self.t[index] = change / h if np.abs(change).max() < _DIVERGED else np.nan
        self.w[index] = white @ ((moved.covariance - base.covariance) / h) @ white.T
        self.more[index] = (moved.more_logdet - base.more_logdet) / h

    def put_slopes(self, at: Ints, slopes: ResponseSlopes, step: Array) -> None:
        """Derivatives of several parameters; those that diverge within a step of a difference are NaN."""
        if at.size == 0:
            return
        white = self.base.white
        t = (slopes.e.reshape(-1, len(white)) @ white.T).reshape(slopes.e.shape)
        lost = np.abs(t).max(axis=(1, 2)) * step >= _DIVERGED
        t[lost] = np.nan
        self.t[at], self.w[at] = t, white @ slopes.covariance @ white.T
        self.more[at] = slopes.more_logdet

    def take(self, old: Sensitivities) -> None:
        turn = np.linalg.solve(old.white.T, self.base.white.T)
        self.t[:] = old.t @ turn
        self.w[:] = turn.T @ old.w @ turn
        self.more[:] = old.more

    @property
    def sensitivities(self) -> Sensitivities:
        """The response with what was put or taken."""
        base = self.base
        r = base.e @ base.white.T
        return Sensitivities(r, base.logdet, self.t, self.w, base.white, self.more)


__all__ = ["InnovationDerivatives", "Sensitivities"]
