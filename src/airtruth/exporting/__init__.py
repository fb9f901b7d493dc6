"""The identified motion as a linear state-space model for other programs: MATLAB, Simulink, python-control."""

from airtruth.exporting.model import FlightPoint, LinearModel
from airtruth.exporting.sources import linear_model
from airtruth.exporting.write import SUFFIXES, write

__all__ = ["SUFFIXES", "FlightPoint", "LinearModel", "linear_model", "write"]
