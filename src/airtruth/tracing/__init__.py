"""Trace: from the residual of measured records to the effect that the declared aircraft lacks."""

from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.motions import trace
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.result import TraceResult

__all__ = ["TraceAnswer", "TraceOptions", "TraceResult", "trace"]
