"""Free runs and modes against the tolerances of a training simulator (`airtruth.physics.proof_of_match`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from airtruth.physics.lateral import lateral_scale
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.proof_of_lateral import LateralProof, lateral_proof
from airtruth.physics.proof_of_match import PITCH, PROOFS, Proof, pitch_change
from airtruth.tracing.inference.assess import Assessment
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.stage_errors import BySet, Excursions, Tolerances
from airtruth.tracing.stages import Stages

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Excursion:
    """Largest distances of one free run from its record.

    Attributes
    ----------
    distances : quantity -> largest distance, in SI; that of the pitch angle is the integral of that of the pitch rate.
    share : share of the samples at which every quantity is inside; pitch angle or pitch rate is enough [-].
    within : whether every quantity is inside throughout; of pitch angle and pitch rate one of them.
    """

    distances: dict[str, float]
    share: float
    within: bool


def excursion(
    residual: Array, measured: Array, channels: Sequence[str], dt_s: float, proof: Proof
) -> Excursion:
    """Largest residuals of a free run, and the share of its samples inside the tolerances.

    Parameters
    ----------
    residual, measured : (samples, outputs) of ``channels``, in SI.
    channels : columns of the log.
    dt_s : sample period [s].
    proof : the tolerances.
    """
    distances, inside = {}, {}
    if proof.pitch is not None:
        rate = residual[:, channels.index(LONGITUDINAL.gyros[0])]
        pitch = np.abs(pitch_change(rate, dt_s * np.arange(len(rate), dtype=np.float64)))
        distances[PITCH], inside[PITCH] = float(pitch.max()), pitch <= proof.pitch.absolute
    for channel, own in proof.tolerances.items():
        i = channels.index(channel)
        distance = np.abs(residual[:, i])
        distances[channel] = float(distance.max())
        inside[channel] = distance <= own.allowed(measured[:, i])
    # one of pitch angle and pitch rate, and each of the others
    groups = [[PITCH, *LONGITUDINAL.gyros]] if PITCH in inside else []
    groups += [[name] for name in inside if name not in {n for group in groups for n in group}]
    at_each = np.all([np.any([inside[name] for name in group], axis=0) for group in groups], axis=0)
    within = all(any(bool(inside[name].all()) for name in group) for group in groups)
    return Excursion(distances, float(at_each.mean()), within)


def tolerances(stages: Stages) -> Tolerances:
    """Compare the free runs of every stage with the tolerances of the motion, and its modes."""
    fitted, held = stages.case.fitted, stages.case.held
    proof = PROOFS[fitted.layout.motion.name]
    found = {}
    for name, assessed in stages.fitted.items():
        of_held = None if held is None else _compare(stages.held[name], held, proof)
        found[name] = BySet(_compare(assessed, fitted, proof), of_held)
    limits = {} if proof.pitch is None else {PITCH: proof.pitch.absolute}
    limits |= {channel: own.absolute for channel, own in proof.tolerances.items()}
    return Tolerances(proof.source, limits, found, _modes(stages))


def _compare(assessed: Sequence[Assessment], problem: TraceProblem, proof: Proof) -> Excursions:
    channels = problem.layout.motion.output_channels
    found = [
        excursion(a.residual, record.signals.y, channels, record.signals.dt_s, proof)
        for a, record in zip(assessed, problem.records, strict=True)
    ]
    return Excursions(
        distances={name: max(e.distances[name] for e in found) for name in found[0].distances},
        share_inside=float(np.mean([e.share for e in found])),
        records_within=sum(e.within for e in found),
        records=len(found),
    )


def _modes(stages: Stages) -> dict[str, dict[str, float | None]]:
    """Stage -> what the tests of the lateral modes compare, at the mean condition; empty for another motion."""
    problem = stages.case.fitted
    if problem.layout.motion is not LATERAL:
        return {}
    records = problem.records
    declared = problem.declared_derivatives
    means = (
        [r.signals.airspeed_m_s for r in records],
        [r.signals.density_kg_m3 for r in records],
        [np.array(r.plant.trim_alpha_rad) for r in records],
        [r.signals.theta_rad for r in records],
    )
    scale = lateral_scale(
        records[0].plant.aircraft.constants,
        *(float(np.mean([x.mean() for x in series])) for series in means),
    )
    return {
        name: _finite(lateral_proof(declared + model.common[problem.layout.common.derivatives], scale))
        for name, model in stages.models.items()
    }


def _finite(proof: LateralProof) -> dict[str, float | None]:
    return {name: value if np.isfinite(value) else None for name, value in asdict(proof).items()}


__all__ = ["Excursion", "excursion", "tolerances"]
