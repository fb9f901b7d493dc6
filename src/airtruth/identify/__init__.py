"""Identify: the six short-period derivatives of a flight log, by least squares and instruments."""

from airtruth.identify.actuator import identify_actuator
from airtruth.identify.auxiliary import linear_auxiliary
from airtruth.identify.condition import AircraftConstants
from airtruth.identify.covariance import COVARIANCES
from airtruth.identify.diagnostics import Diagnostics, diagnose, residuals
from airtruth.identify.estimate import identify_batch, identify_joint, identify_log
from airtruth.identify.files import identify_files, overview
from airtruth.identify.methods import METHODS, Method
from airtruth.identify.options import AuxiliaryModel, Options
from airtruth.identify.results import SENTENCES, Estimates, Quantities, Status, estimates_table, quantities
from airtruth.identify.srivc import TransferFunctions, srivc
from airtruth.identify.summary import Table, as_csv, as_html, as_json, as_text, compare, summary

__all__ = [
    "COVARIANCES",
    "METHODS",
    "SENTENCES",
    "AircraftConstants",
    "AuxiliaryModel",
    "Diagnostics",
    "Estimates",
    "Method",
    "Options",
    "Quantities",
    "Status",
    "Table",
    "TransferFunctions",
    "as_csv",
    "as_html",
    "as_json",
    "as_text",
    "compare",
    "diagnose",
    "estimates_table",
    "identify_actuator",
    "identify_batch",
    "identify_files",
    "identify_joint",
    "identify_log",
    "linear_auxiliary",
    "overview",
    "quantities",
    "residuals",
    "srivc",
    "summary",
]
