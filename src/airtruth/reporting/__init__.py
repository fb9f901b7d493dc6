"""Reports of results, and the paper's tables and figures from flown and identified campaigns."""

from airtruth.reporting.campaign import Campaign, MethodEstimates, read_campaign
from airtruth.reporting.paper.tables import TABLES, Entry, PaperTable, TableSpec, evaluate
from airtruth.reporting.reporter import report
from airtruth.reporting.write import WrittenTables, write_tables

__all__ = [
    "TABLES",
    "Campaign",
    "Entry",
    "MethodEstimates",
    "PaperTable",
    "TableSpec",
    "WrittenTables",
    "evaluate",
    "read_campaign",
    "report",
    "write_tables",
]
