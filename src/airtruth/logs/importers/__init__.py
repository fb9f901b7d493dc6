"""Measured logs in other formats, brought under the log contract by a mapping file."""

from airtruth.logs.importers.convert import Imported, convert, import_log, record_constants
from airtruth.logs.importers.guess import guess_mapping
from airtruth.logs.importers.mapping import MappingFile, read_mapping
from airtruth.logs.importers.plausible import Problem, problems
from airtruth.logs.importers.sources import FORMATS, Source, open_source

__all__ = [
    "FORMATS",
    "Imported",
    "MappingFile",
    "Problem",
    "Source",
    "convert",
    "guess_mapping",
    "import_log",
    "open_source",
    "problems",
    "read_mapping",
    "record_constants",
]
