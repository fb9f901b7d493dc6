"""Kernels that a child process compiles for the commands where the cache is empty."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from typer import Context

from airtruth.numerics.ahead import Ahead, compiling

DYNAMIC: Final = ("iv-f1", "iv-f2")
"""Methods whose kernels take the longest to compile, those of `airtruth.identification.regression.dynamic`."""
IDENTIFY: Final = Ahead(
    "airtruth.identification.regression.ahead", "airtruth.identification.regression.dynamic_kernel._filtered"
)
"""Kernels of these methods."""
TRACE: Final = Ahead("airtruth.tracing.model.ahead", "airtruth.tracing.model.tangent._differences", 2)
"""Kernels of the tracer's filter, for both motions."""


def compile_identification(context: Context, methods: Collection[str], cluster: str | None) -> None:
    """Let a child compile kernels of `airtruth identify` until the command ends, unless a cluster works."""
    if cluster is None and not set(DYNAMIC).isdisjoint(methods):
        context.with_resource(compiling(IDENTIFY))


def compile_filter(context: Context, cluster: str | None) -> None:
    """Let a child compile kernels of `airtruth trace` and `airtruth loop`, as `compile_identification` does."""
    if cluster is None:
        context.with_resource(compiling(TRACE))


__all__ = ["DYNAMIC", "IDENTIFY", "TRACE", "compile_filter", "compile_identification"]
