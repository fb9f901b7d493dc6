"""The only door to the tracer: a log and the declared aircraft in, its answer out."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from airtruth.logs.store import read_log
from validation.blind.figures import DECLARED


def answer(log: Path) -> dict[str, Any]:
    """What `airtruth.tracing` answers to one log, with its default options; of two records it holds out the second."""
    from airtruth.tracing import TraceOptions, trace

    runs = read_log(log, ()).run_ids
    options = TraceOptions(hold_out=runs[1:]) if len(runs) == 2 else TraceOptions()
    return trace(log, DECLARED, options).to_dict()


def call(tracer: str, log: Path) -> dict[str, Any]:
    """Answer of the function ``MODULE:NAME``; an exception becomes {"failed": its text}."""
    module, name = tracer.split(":")
    try:
        return dict(getattr(importlib.import_module(module), name)(log))
    except Exception as error:
        return {"failed": f"{type(error).__name__}: {error}"}
