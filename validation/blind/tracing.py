"""The only door to the tracer: a log and the declared aircraft in, its answer out."""

from __future__ import annotations

import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from airtruth.logs.store import read_log
from validation.blind.figures import DECLARED, WITHHELD


def answer(log: Path) -> dict[str, Any]:
    """What `airtruth.tracing` answers to one log, with its default options; of two records it holds out the second.

    Where names are withheld, it searches the library without them and learns increments as with the whole library.
    """
    from airtruth.effects.registry import EFFECTS
    from airtruth.tracing import TraceOptions, trace

    runs = read_log(log, ()).run_ids
    options = TraceOptions(hold_out=runs[1:]) if len(runs) == 2 else TraceOptions()
    if (file := log.parent / WITHHELD).exists():
        withheld = json.loads(file.read_text())
        rest = (key for key, e in EFFECTS.items() if e.name not in withheld and not e.in_derivatives)
        options = replace(options, effects=tuple(rest), increments=True)
    return trace(log, DECLARED, options).to_dict()


def call(tracer: str, log: Path) -> dict[str, Any]:
    """Answer of the function ``MODULE:NAME``; an exception becomes {"failed": its text}."""
    module, name = tracer.split(":")
    try:
        return dict(getattr(importlib.import_module(module), name)(log))
    except Exception as error:
        return {"failed": f"{type(error).__name__}: {error}"}
