"""The only door to the tracer: a log and the declared aircraft in, its answer out."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from blind.figures import DECLARED


def answer(log: Path) -> dict[str, Any]:
    """What `airtruth.trace` answers to one log, with its default options."""
    from airtruth.trace import TraceOptions, trace

    result = trace([log], aircraft=DECLARED, options=TraceOptions(), out=None)
    return dict(result)


def call(tracer: str, log: Path) -> dict[str, Any]:
    """Answer of the function ``MODULE:NAME``; an exception becomes {"failed": its text}."""
    module, name = tracer.split(":")
    try:
        return dict(getattr(importlib.import_module(module), name)(log))
    except Exception as error:
        return {"failed": f"{type(error).__name__}: {error}"}
