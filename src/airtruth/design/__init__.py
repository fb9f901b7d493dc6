"""Design of experiments: accuracy of a campaign before it is flown; the input that separates effects or narrows estimates."""

from airtruth.design.band import BandQuestion
from airtruth.design.bound import ForecastResult, forecast, moved_motions
from airtruth.design.flight import PlanOptions
from airtruth.design.lateral_flight import LateralPlan
from airtruth.design.lateral_splitting import LateralSplit
from airtruth.design.limits import Limits
from airtruth.design.narrow_result import NarrowResult
from airtruth.design.narrowing import narrow
from airtruth.design.precision import DerivativeQuestion
from airtruth.design.split_result import SplitResult
from airtruth.design.splitting import split

__all__ = [
    "BandQuestion",
    "DerivativeQuestion",
    "ForecastResult",
    "LateralPlan",
    "LateralSplit",
    "Limits",
    "NarrowResult",
    "PlanOptions",
    "SplitResult",
    "forecast",
    "moved_motions",
    "narrow",
    "split",
]
