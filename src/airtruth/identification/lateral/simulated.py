"""A lateral record beside the motion that its derivatives predict: the predictor of output error at given derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airtruth.identification.lateral.predictor import outputs_of, records_of
from airtruth.identification.likelihood.kalman import score
from airtruth.identification.likelihood.method import GUST_LENGTH_M
from airtruth.identification.options import Options
from airtruth.logs.flight_log import Batch
from airtruth.physics.lateral import LateralConstants
from airtruth.physics.motion import LATERAL

Array = NDArray[np.float64]


def simulate(theta: Array, batch: Batch, constants: LateralConstants) -> Array:
    """Outputs of the linear lateral motion for a record, its initial state and output biases fitted.

    The surfaces are those of the record, as are the known inputs: airspeed, alpha, q and theta, and what the products of the
    measured signals with them add to the linear motion (`airtruth.identification.lateral.predictor`). The fit weights the
    outputs by their standard deviations.

    Parameters
    ----------
    theta : (15,) derivatives in the order of `airtruth.physics.motion.LATERAL`.
    batch : one run; constants : of the aircraft.

    Returns
    -------
    (samples, outputs)
        Simulated outputs that the record has; NaN where the motion diverges.
    """
    data = records_of(batch, constants, Options(), GUST_LENGTH_M, gusts=False)
    channels = {output.name: output.channel for output in LATERAL.outputs}
    measured = np.stack([batch.channels[channels[name]][0] for name in outputs_of(batch)], axis=1)
    spread = np.maximum(measured.std(axis=0), np.finfo(np.float64).tiny)
    z = np.concatenate([theta, np.log(spread)])[None]
    made = score(data.layout, np.arange(1), z, np.empty(0, dtype=np.int64), data.signals, data.dt_s)
    if not np.isfinite(made.cost[0]):
        return np.full_like(measured, np.nan)
    return np.asarray(measured - made.innovations[0] * spread)


__all__ = ["simulate"]
