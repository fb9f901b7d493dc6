"""The case as the search takes it: its noise, its corners and its airspeed as its own records show them."""

from __future__ import annotations

from airtruth.tracing.calibration.airspeed_error import with_corrected_airspeed
from airtruth.tracing.calibration.corner_share import with_corner_share
from airtruth.tracing.calibration.noise_colour import with_coloured_noise
from airtruth.tracing.model.parameters import Parameters
from airtruth.tracing.prepare import Case


def calibrated(case: Case) -> tuple[Case, Parameters]:
    """The calibrated case, and the parameters of the declared aircraft at which its search begins."""
    case, start = with_coloured_noise(case)
    return with_corrected_airspeed(with_corner_share(case, start), start), start


__all__ = ["calibrated"]
