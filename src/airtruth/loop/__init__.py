"""The closed loop: trace, take the traced effects out of the records, identify again, compare before and after."""

from airtruth.loop.changes import DerivativeChange
from airtruth.loop.layout import NAME, loop_chart, loop_table
from airtruth.loop.result import OUTPUTS, LoopResult
from airtruth.loop.run import METHODS, close_loop, identify_without_effects

__all__ = [
    "METHODS",
    "NAME",
    "OUTPUTS",
    "DerivativeChange",
    "LoopResult",
    "close_loop",
    "identify_without_effects",
    "loop_chart",
    "loop_table",
]
