"""The files of a trace that hold its evidence: records and errors."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Final

from airtruth.logs.atomic import make_folder, write_text
from airtruth.logs.histories import FILE, Histories, write_histories
from airtruth.table import WIDTH
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.error_table import error_csv
from airtruth.tracing.presentation.text import verdict

ERRORS: Final = "error.csv"
"""File of the errors in long form."""
PROVISIONAL: Final = "provisional.txt"
"""File of an updated aircraft whose answer is provisional."""
EVIDENCE: Final = (FILE, ERRORS)
"""Every file of `write_evidence`."""


def mark_provisional(answer: TraceAnswer) -> Path | None:
    """Write the reservations of a provisional answer into its updated aircraft, which people copy without trace.json.

    Returns
    -------
    The file; None where the answer is not provisional or has no updated aircraft.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    if not answer.provisional or answer.updated_aircraft is None:
        return None
    file = Path(answer.updated_aircraft) / PROVISIONAL
    lines = [verdict(answer), *(f"{note}." for note in answer.notes)]
    write_text(file, "\n\n".join(textwrap.fill(line, WIDTH) for line in lines) + "\n")
    return file


def write_evidence(answer: TraceAnswer, histories: Histories, out: Path) -> tuple[Path, ...]:
    """Write the records of a trace and its errors into its folder.

    Parameters
    ----------
    answer : of a finished trace.
    histories : its records.
    out : folder, created if it does not exist.

    Returns
    -------
    The files, `EVIDENCE`.

    Raises
    ------
    StoreError
        If a file cannot be written.
    """
    make_folder(out)
    write_histories(out / FILE, histories)
    write_text(out / ERRORS, error_csv(answer))
    return tuple(out / name for name in EVIDENCE)


__all__ = ["ERRORS", "EVIDENCE", "PROVISIONAL", "mark_provisional", "write_evidence"]
