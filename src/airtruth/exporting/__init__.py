"""The identified motion as a linear state-space model for other programs: MATLAB, Simulink, python-control."""

from airtruth.exporting.model import LinearModel, OperatingPoint
from airtruth.exporting.sources import linear_model
from airtruth.exporting.write import SUFFIXES, write

__all__ = ["SUFFIXES", "LinearModel", "OperatingPoint", "linear_model", "write"]
