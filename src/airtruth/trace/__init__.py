"""Trace: from the residual of measured records to the effect that the declared aircraft lacks."""

from airtruth.trace.options import TraceOptions
from airtruth.trace.tracing import Trace, run, trace, traced

__all__ = ["Trace", "TraceOptions", "run", "trace", "traced"]
