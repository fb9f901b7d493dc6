"""Reports of results, and the paper's tables and figures from flown and identified campaigns."""

from airtruth.reporting.campaign import FlownCampaign, MethodEstimates, read_campaign
from airtruth.reporting.paper.tables import TABLES, PaperEntry, PaperTable, TableSpec, evaluate
from airtruth.reporting.reporter import TRACE_PAGE, draw_traces, report
from airtruth.reporting.write import WrittenTables, write_tables

__all__ = [
    "TABLES",
    "TRACE_PAGE",
    "FlownCampaign",
    "MethodEstimates",
    "PaperEntry",
    "PaperTable",
    "TableSpec",
    "WrittenTables",
    "draw_traces",
    "evaluate",
    "read_campaign",
    "report",
    "write_tables",
]
