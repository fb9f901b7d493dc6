"""Design of experiments: the accuracy of a campaign before it is flown, and the input that separates two effects."""

from airtruth.design.bound import ForecastResult, forecast
from airtruth.design.limits import Limits
from airtruth.design.split_result import SplitResult
from airtruth.design.splitting import SplitOptions, split

__all__ = ["ForecastResult", "Limits", "SplitOptions", "SplitResult", "forecast", "split"]
