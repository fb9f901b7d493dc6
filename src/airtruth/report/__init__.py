"""Tables and figures of flown and identified campaigns, beside the published ones.

`airtruth.report.figures`, `distribution` and `trace_figures` draw; they import matplotlib, the rest does not.
"""

from typing import TYPE_CHECKING, Any

from airtruth.report.campaign import Campaign, MethodEstimates, read_campaign
from airtruth.report.html import write_report
from airtruth.report.tables import TABLES, Entry, Table, TableSpec, evaluate
from airtruth.report.trace_text import as_trace_text
from airtruth.report.write import WrittenTables, write_tables

if TYPE_CHECKING:
    from airtruth.report.trace_figures import write_trace_figures

__all__ = [
    "TABLES",
    "Campaign",
    "Entry",
    "MethodEstimates",
    "Table",
    "TableSpec",
    "WrittenTables",
    "as_trace_text",
    "evaluate",
    "read_campaign",
    "write_report",
    "write_tables",
    "write_trace_figures",
]


def __getattr__(name: str) -> Any:
    """What draws is imported when it is asked for: matplotlib takes its time."""
    if name == "write_trace_figures":
        from airtruth.report.trace_figures import write_trace_figures

        return write_trace_figures
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
