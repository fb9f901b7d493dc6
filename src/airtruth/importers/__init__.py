"""Measured logs in other formats, brought under the log contract by a mapping file."""

from airtruth.importers.constants import record_constants
from airtruth.importers.convert import Imported, convert, find_manoeuvres, import_log
from airtruth.importers.dictionary import Words, read_dictionary
from airtruth.importers.guess import guess_mapping
from airtruth.importers.manoeuvre_result import ManoeuvreResult
from airtruth.importers.manoeuvres import read_table
from airtruth.importers.mapping import MappingFile, read_mapping
from airtruth.importers.sources import FORMATS, Source, open_source

__all__ = [
    "FORMATS",
    "Imported",
    "ManoeuvreResult",
    "MappingFile",
    "Source",
    "Words",
    "convert",
    "find_manoeuvres",
    "guess_mapping",
    "import_log",
    "open_source",
    "read_dictionary",
    "read_mapping",
    "read_table",
    "record_constants",
]
