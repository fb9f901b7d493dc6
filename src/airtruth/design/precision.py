"""Derivatives that a flight has to determine: their standard errors from an input, averaged over what is not yet known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.design.bench import Bench, Flown
from airtruth.design.flight import gusts
from airtruth.design.information import LinearExperiment, sensor_noise
from airtruth.design.narrow_result import Quantity
from airtruth.errors import ConfigurationError, choices
from airtruth.physics.motion import LONGITUDINAL, MOTIONS
from airtruth.physics.terms import Change, DerivativeTerm
from airtruth.simulation.campaign.file import Campaign

Array = NDArray[np.float64]

DRAWS: Final = 6
"""Draws of the derivatives behind a stated standard error [-] (judgement, as for a separation)."""
_FIRST: Final = 2
"""Draws during the search [-] (judgement: a draw and its opposite)."""
_FLOWN_SIGMA: Final = 1.5
"""Change of the derivatives with which the limits are kept besides, in declared standard deviations [-] (judgement: the
largest draw of a size in a separation)."""


@dataclass(frozen=True)
class DerivativeQuestion:
    """Derivatives that a flight has to determine.

    Attributes
    ----------
    names : of ``LONGITUDINAL.parameters``.
    """

    names: tuple[str, ...]

    def __post_init__(self) -> None:
        """Refuse names that are none.

        Raises
        ------
        ConfigurationError
            Naming the first one and the allowed names.
        """
        for name in self.names:
            other = next(
                (m for m in MOTIONS.values() if m is not LONGITUDINAL and name in m.parameters), None
            )
            if other is not None:
                raise ConfigurationError(
                    f"plan: derivative {name!r} belongs to the {other.heading.lower()}, and an input determines those of one "
                    "motion; plan the derivatives of each motion by a command of its own"
                )
            if name not in LONGITUDINAL.parameters:
                raise ConfigurationError(
                    f"plan: derivative {name!r}: {choices(name, LONGITUDINAL.parameters)}"
                )
        if not self.names or len(set(self.names)) < len(self.names):
            raise ConfigurationError(
                f"plan: derivatives {', '.join(self.names) or 'none'}: state each once, such as --derivative Cmq,Cmde"
            )

    @property
    def title(self) -> str:
        """The purpose of the input."""
        return f"the input that determines {', '.join(self.names)}"

    def at(self, bench: Bench, campaign: Campaign, records: int, seed: int) -> Precision:
        """Their standard errors at a flight condition.

        Parameters
        ----------
        bench : of the condition.
        campaign : gusts and sensors.
        records : equal records.
        seed : seed of the draws.

        Raises
        ------
        ConfigurationError
            If a sensor has no noise.
        """
        aircraft, covariance = bench.aircraft, bench.plant.derivative_cov
        outputs = [output.channel for output in LONGITUDINAL.outputs]
        noise = sensor_noise(campaign.sensors.apply(aircraft.file.sensors), aircraft, outputs)
        experiment = LinearExperiment(
            aircraft,
            noise,
            gusts(campaign, bench.condition),
            bench.trim.airspeed_m_s,
            bench.log_dt_s,
            campaign.gust.start,
        )
        root, rng = np.linalg.cholesky(covariance), np.random.default_rng(seed)
        drawn = [root @ rng.standard_normal(6) for _ in range(DRAWS // 2)]
        return Precision(
            names=self.names,
            experiment=experiment,
            theta=bench.linear.plus,
            declared_std=np.sqrt(np.diag(covariance)),
            draws=tuple(sign * d for d in drawn for sign in (1.0, -1.0)),
            records=records,
        )


@dataclass(frozen=True)
class Precision:
    """Standard errors of derivatives at a flight condition; a `airtruth.design.search.Merit`.

    Attributes
    ----------
    names : derivatives that count.
    experiment : what a record has besides its elevator.
    theta, declared_std : (6,) declared derivatives and their standard deviations [-].
    draws : (6,) increments each, in pairs of opposite sign [-].
    records : equal records.
    """

    names: tuple[str, ...]
    experiment: LinearExperiment
    theta: Array
    declared_std: Array
    draws: tuple[Array, ...]
    records: int

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of what is determined."""
        return self.names

    @property
    def known(self) -> Array:
        """(targets,) standard deviations that are declared [-]."""
        return self.declared_std[self._index]

    @property
    def gust_m_s(self) -> float:
        """Standard deviation of the vertical gust [m/s]."""
        return self.experiment.gusts.sigma_w_m_s

    @property
    def changes(self) -> tuple[Change, ...]:
        """Aircraft with which the limits are kept besides."""
        return tuple(
            Change(
                derivatives=tuple(
                    DerivativeTerm(name, sign * _FLOWN_SIGMA * float(std))
                    for name, std in zip(self.names, self.known, strict=True)
                )
            )
            for sign in (1.0, -1.0)
        )

    @property
    def _index(self) -> list[int]:
        return [LONGITUDINAL.parameters.index(name) for name in self.names]

    def rate(self, flown: Flown, *, final: bool = False) -> Array | None:
        """(targets,) declared over expected standard deviation [-]; None if a draw has no bound."""
        variance = self._variance(flown, final=final)
        return self.known / np.sqrt(variance) if (variance > 0.0).all() else None

    def _variance(self, flown: Flown, *, final: bool) -> Array:
        """(targets,) mean over the draws; nan where a draw has no bound."""
        draws = self.draws if final else self.draws[:_FIRST]
        each = [np.diag(self.experiment.least_covariance(flown.channels, self.theta + d)) for d in draws]
        return np.asarray(np.mean(each, axis=0)[self._index] / self.records)

    def quantities(self, flown: Flown, reference: Flown) -> tuple[Quantity, ...]:
        """The derivatives with their standard errors by an input and by the reference."""
        index = self._index
        columns = [self.theta[index], self.known]
        columns += [np.sqrt(self._variance(f, final=True)) for f in (flown, reference)]
        columns += [self.experiment.linear_error(f.channels, self.theta)[index] for f in (flown, reference)]
        rows = np.stack(columns, axis=1).tolist()
        return tuple(Quantity(name, None, *row) for name, row in zip(self.names, rows, strict=True))


__all__ = ["DRAWS", "DerivativeQuestion", "Precision"]
