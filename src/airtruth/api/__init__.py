"""The public functions of ``import airtruth as at``.

Each function loads the modules that it needs when it is called. Wherever ``logs`` is an argument, it is a log file,
a campaign folder, a folder of logs, a `FlightLog`, or a sequence of these; wherever ``aircraft`` is an argument, it
is a folder with aircraft.toml, that file, the name of a shipped aircraft, or a loaded `Aircraft`. Quantities are in
SI and radians.
"""

from airtruth.api.campaigns import fly, list_effects, load_aircraft, verify
from airtruth.api.exports import export
from airtruth.api.logs import check, find_manoeuvres, import_log, read_log
from airtruth.api.models import close_loop, identify, report, trace
from airtruth.api.plans import plan

__all__ = [
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
]
