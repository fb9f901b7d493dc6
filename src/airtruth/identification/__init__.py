"""Identification: the derivatives of a motion from flight logs, by regression and by likelihood."""

from airtruth.identification.answers import Answer, answers
from airtruth.identification.condition import AircraftConstants
from airtruth.identification.diagnostics import Diagnostics, diagnose, residuals
from airtruth.identification.estimates import (
    SENTENCES,
    Estimates,
    Quantities,
    Status,
    estimates_table,
    quantities,
)
from airtruth.identification.methods import LATERAL_METHODS, METHODS, Method
from airtruth.identification.options import AuxiliaryModel, Options
from airtruth.identification.regression.auxiliary import linear_auxiliary
from airtruth.identification.regression.covariance import COVARIANCES
from airtruth.identification.regression.lowpass import identify_actuator
from airtruth.identification.result import (
    IdentificationResult,
    IdentificationSettings,
    LogSource,
    SpooledResult,
    json_of,
    settings_of,
)
from airtruth.identification.run import identified, identify, identify_batch, identify_joint
from airtruth.identification.store import FILES, beside, require_mergeable, write_estimates
from airtruth.identification.tables import overview

__all__ = [
    "COVARIANCES",
    "FILES",
    "LATERAL_METHODS",
    "METHODS",
    "SENTENCES",
    "AircraftConstants",
    "Answer",
    "AuxiliaryModel",
    "Diagnostics",
    "Estimates",
    "IdentificationResult",
    "IdentificationSettings",
    "LogSource",
    "Method",
    "Options",
    "Quantities",
    "SpooledResult",
    "Status",
    "answers",
    "beside",
    "diagnose",
    "estimates_table",
    "identified",
    "identify",
    "identify_actuator",
    "identify_batch",
    "identify_joint",
    "json_of",
    "linear_auxiliary",
    "overview",
    "quantities",
    "require_mergeable",
    "residuals",
    "settings_of",
    "write_estimates",
]
