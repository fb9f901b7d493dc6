"""Trace: from the residual of measured records to the effect that the declared aircraft lacks."""

from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.result import TraceResult
from airtruth.tracing.run import trace

__all__ = ["TraceAnswer", "TraceOptions", "TraceResult", "trace"]
