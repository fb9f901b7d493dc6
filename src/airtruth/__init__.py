"""Correct a flight model with flight-test records: fly, identify, trace, close the loop.

``import airtruth as at`` gives every name of `__all__`. A name loads its module when it is first used, so the
import itself takes a few milliseconds.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from airtruth.errors import (
    AircraftError,
    AirtruthError,
    ConfigurationError,
    FlightError,
    LogError,
    StoreError,
    TrimError,
)

if TYPE_CHECKING:
    from airtruth.aircraft import Aircraft
    from airtruth.api import (
        check,
        close_loop,
        export,
        find_manoeuvres,
        fly,
        identify,
        import_log,
        list_effects,
        load_aircraft,
        plan,
        read_log,
        report,
        trace,
        verify,
    )
    from airtruth.checks.result import CheckResult
    from airtruth.design import ForecastResult, Limits, NarrowResult, SplitResult
    from airtruth.effects.effect import Effect
    from airtruth.exporting import LinearModel
    from airtruth.identification import IdentificationResult
    from airtruth.identification.options import Options as IdentificationOptions
    from airtruth.importers import Imported, ManoeuvreResult
    from airtruth.logs.flight_log import FlightLog
    from airtruth.logs.sources import Logs
    from airtruth.logs.store import write_log
    from airtruth.logs.verify import Verification
    from airtruth.loop import LoopResult
    from airtruth.result import Result
    from airtruth.simulation.campaign.file import Campaign
    from airtruth.simulation.campaign.result import CampaignResult
    from airtruth.tracing.options import TraceOptions
    from airtruth.tracing.result import TraceResult

__version__ = "0.2.0"

_LAZY = {
    "Aircraft": "airtruth.aircraft",
    "Campaign": "airtruth.simulation.campaign.file",
    "CampaignResult": "airtruth.simulation.campaign.result",
    "CheckResult": "airtruth.checks.result",
    "Effect": "airtruth.effects.effect",
    "FlightLog": "airtruth.logs.flight_log",
    "ForecastResult": "airtruth.design",
    "IdentificationOptions": "airtruth.identification.options:Options",
    "IdentificationResult": "airtruth.identification",
    "Imported": "airtruth.importers",
    "Logs": "airtruth.logs.sources",
    "Limits": "airtruth.design",
    "LinearModel": "airtruth.exporting",
    "LoopResult": "airtruth.loop",
    "ManoeuvreResult": "airtruth.importers",
    "NarrowResult": "airtruth.design",
    "Result": "airtruth.result",
    "SplitResult": "airtruth.design",
    "TraceOptions": "airtruth.tracing.options",
    "TraceResult": "airtruth.tracing.result",
    "Verification": "airtruth.logs.verify",
    "check": "airtruth.api",
    "close_loop": "airtruth.api",
    "export": "airtruth.api",
    "find_manoeuvres": "airtruth.api",
    "fly": "airtruth.api",
    "identify": "airtruth.api",
    "import_log": "airtruth.api",
    "list_effects": "airtruth.api",
    "load_aircraft": "airtruth.api",
    "plan": "airtruth.api",
    "read_log": "airtruth.api",
    "report": "airtruth.api",
    "trace": "airtruth.api",
    "verify": "airtruth.api",
    "write_log": "airtruth.logs.store",
}
"""Public name -> module that defines it, with ``:name`` where it has another name there."""


def __getattr__(name: str) -> object:
    """Load the module of a public name (PEP 562)."""
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, original = _LAZY[name].partition(":")
    value = getattr(import_module(module), original or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted({*globals(), *__all__})


__all__ = [
    "Aircraft",
    "AircraftError",
    "AirtruthError",
    "Campaign",
    "CampaignResult",
    "CheckResult",
    "ConfigurationError",
    "Effect",
    "FlightError",
    "FlightLog",
    "ForecastResult",
    "IdentificationOptions",
    "IdentificationResult",
    "Imported",
    "Limits",
    "LinearModel",
    "LogError",
    "Logs",
    "LoopResult",
    "ManoeuvreResult",
    "NarrowResult",
    "Result",
    "SplitResult",
    "StoreError",
    "TraceOptions",
    "TraceResult",
    "TrimError",
    "Verification",
    "__version__",
    "check",
    "close_loop",
    "export",
    "find_manoeuvres",
    "fly",
    "identify",
    "import_log",
    "list_effects",
    "load_aircraft",
    "plan",
    "read_log",
    "report",
    "trace",
    "verify",
    "write_log",
]
