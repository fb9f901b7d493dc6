"""Flights of the filter with signals added to the coefficients and to the outputs, of which tests take differences."""

from typing import NamedTuple

import numpy as np

from airtruth.tracing.model import filter as record_filter
from airtruth.tracing.model.by_motion import coefficients_of
from airtruth.tracing.model.response import LOST, kernel_input
from airtruth.tracing.model.steady import steady_filter


class Added(NamedTuple):
    """Signals.

    Attributes
    ----------
    force : (coefficients, points) in the order of the motion [-].
    output : (samples, outputs) [units of the outputs].
    """

    force: np.ndarray
    output: np.ndarray


def flown_with(added, given, settings, common, per_record, *, free_run=False, steady=None):
    """(samples, outputs) innovations, or residuals of a free run, with added signals over the counted part of a record."""
    kernel = kernel_input(given, settings, common, per_record)
    force = {name: getattr(kernel.grid, name).copy() for name in coefficients_of(kernel.grid)}
    for row, own in zip(force.values(), added.force, strict=True):
        row[-own.size :] += own
    more = kernel.more.copy()
    more[given.lead :] += added.output
    kernel = kernel._replace(grid=kernel.grid._replace(**force), more=more)
    e = np.full_like(kernel.y, LOST)
    if free_run:
        record_filter.free_run(kernel, e)
    else:
        record_filter.innovations(kernel, steady or steady_filter(kernel, given.along), e)
    return e[given.lead :]
