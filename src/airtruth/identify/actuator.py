"""The elevator rebuilt from its command through an identified first-order actuator.

Source: M. Brunot, "An Instrumental Variable Approach for Aircraft Identification", IV.B: "the transfer
between de_r and de is identified as a continuous-time first order system" by SRIVC.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.identify.srivc import TransferFunctions, simulate, srivc

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

START_RAD_S: Final = 2.0 * np.pi * 5.0
"""Pole of the first filter [rad/s]: a typical servo; the estimate does not depend on it."""


def identify_actuator(command: Array, elevator: Array, dt_s: float) -> TransferFunctions:
    """First-order actuator b/(p + a) of each run; the command is held between samples.

    Parameters
    ----------
    command, elevator : (runs, samples) [rad].
    dt_s : sample period [s].
    """
    return srivc(command, elevator, dt_s, na=1, nb=1, start_rad_s=START_RAD_S)


def estimated_elevator(command: Array, elevator: Array, dt_s: float) -> tuple[Array, Bools]:
    """Noise-free elevator (runs, samples), relative to its start [rad], and the runs that have none.

    A run has none where no stable actuator was found; its row is zero.
    """
    model = identify_actuator(command, elevator, dt_s)
    failed = ~model.converged
    usable = TransferFunctions(
        np.where(failed[:, None], 1.0, model.a),
        np.where(failed[:, None], 0.0, model.b),
        model.converged,
        model.iterations,
    )
    return simulate(usable, command - command[:, :1], dt_s), failed
