"""Estimates from arrays: of each run of a batch, and of several batches together. Nothing is checked."""

from __future__ import annotations

from collections.abc import Sequence

from airtruth.errors import ConfigurationError
from airtruth.identification.condition import AircraftConstants, OneOrEach
from airtruth.identification.estimates import Estimates
from airtruth.identification.methods import Method, method, regression
from airtruth.identification.options import Options
from airtruth.identification.reconstructed import with_reconstruction
from airtruth.identification.regression.solve import regress_batch, regress_joint
from airtruth.logs.flight_log import Batch
from airtruth.physics.motion import LONGITUDINAL, Motion


def identify_batch(
    batch: Batch,
    constants: AircraftConstants,
    name: str | Method,
    options: Options | None = None,
    motion: Motion = LONGITUDINAL,
) -> Estimates:
    """Estimate the derivatives of a motion for each run; nothing is checked.

    A result does not depend on the other runs of the batch.

    Parameters
    ----------
    batch : runs of one length and sample period, as `airtruth.logs.flight_log.batches` makes them.
    constants : aircraft, any object with wing_area_m2, chord_m, mass_kg, inertia_yy_kg_m2; for the lateral-directional motion
        also span_m, inertia_xx_kg_m2, inertia_zz_kg_m2, inertia_xz_kg_m2.
    name : method of the motion, a key of `airtruth.identification.METHODS`, or a `Method`.
    options : choices; None for the defaults.
    motion : whose derivatives are estimated.

    Raises
    ------
    ConfigurationError
        If the method does not exist.
    """
    chosen = method(name, motion)

    def estimate(parts: Sequence[Batch], options: Options) -> Estimates:
        if chosen.estimate is not None:
            return chosen.estimate(parts[0], constants, options)
        pose = regression(chosen) if chosen.iterates else None
        return regress_batch(parts[0], constants, chosen.name, pose, options)

    return with_reconstruction(estimate, [batch], options or Options())


def identify_joint(
    parts: Sequence[Batch],
    constants: OneOrEach,
    name: str | Method,
    options: Options | None = None,
    motion: Motion = LONGITUDINAL,
) -> Estimates:
    """One estimate for all runs together; nothing is checked.

    The normal equations of all runs are summed. Trim, flight condition and filters remain each run's own.
    All runs are held in memory.

    Parameters
    ----------
    parts : batches; lengths and rates may differ.
    constants : of all batches, or one entry for each: mass and inertia may differ.
    name, options, motion : as in `identify_batch`.

    Raises
    ------
    ConfigurationError
        If the method does not exist, or estimates each run alone.
    """
    chosen = method(name, motion)
    if chosen.estimate is not None and chosen.estimate_joint is None:
        raise ConfigurationError(
            f"method {chosen.name} has no estimate_joint: identify each run, or give the Method that function"
        )

    def estimate(parts: Sequence[Batch], options: Options) -> Estimates:
        if chosen.estimate_joint is not None:
            return chosen.estimate_joint(parts, constants, options)
        pose = regression(chosen) if chosen.iterates else None
        return regress_joint(parts, constants, chosen.name, pose, options)

    return with_reconstruction(estimate, parts, options or Options())


__all__ = ["identify_batch", "identify_joint"]
