"""Tables and figures of flown and identified campaigns, beside the published ones.

`airtruth.report.figures` and `airtruth.report.distribution` draw; they import matplotlib, the rest does not.
"""

from airtruth.report.campaign import Campaign, MethodEstimates, read_campaign
from airtruth.report.tables import TABLES, Entry, Table, TableSpec, evaluate
from airtruth.report.write import WrittenTables, write_tables

__all__ = [
    "TABLES",
    "Campaign",
    "Entry",
    "MethodEstimates",
    "Table",
    "TableSpec",
    "WrittenTables",
    "evaluate",
    "read_campaign",
    "write_tables",
]
