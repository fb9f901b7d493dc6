"""Dates and times of day in text files, as seconds."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

_KINDS: Final = "mM"
"""Kinds of numpy types that are durations or dates."""
_PER_SECOND: Final = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
"""Unit of pandas' dates and durations -> integers per second."""
_TIME: Final = r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?"
"""Time of day."""
_DATE: Final = r"\d{4}([-/])\d{2}\3\d{2}"
"""Date with the year first, the only order that is not ambiguous."""
_OF_DAY: Final = re.compile(rf"\s*{_TIME}\s*")
"""Cell with a time of day."""
_DATED: Final = re.compile(
    r"\s*\d{4}([-/])\d{2}\1\d{2}([T ]\s*" + _TIME.replace("(", "(?:") + r"(Z|[+-]\d{2}:?\d{2})?)?\s*"
)
"""Cell with a date, and perhaps a time and its zone (ISO 8601)."""


def is_time(text: str) -> bool:
    """Whether a cell is a date with the year first, a time of day, or both."""
    cell = text.strip().strip('"')
    return bool(_OF_DAY.fullmatch(cell) or _DATED.fullmatch(cell))


def seconds_of_text(cells: NDArray[Any]) -> NDArray[np.float64] | None:
    """Seconds since 1970 of dates, and since midnight of times of day; None if a cell is neither, or all are empty.

    Parameters
    ----------
    cells : (rows,) of objects; None, NaN and empty text are NaN.
    """
    import pandas as pd

    first = next((cell for cell in cells if isinstance(cell, str) and cell.strip()), None)
    if first is None or not is_time(first):
        return None
    column = pd.Series(cells)
    empty = column.isna().to_numpy()
    if not all(isinstance(cell, str) for cell in cells[~empty]):
        return None
    text = column.str.strip().str.strip('"').str.replace(",", ".").mask(column.str.strip() == "")
    form = _OF_DAY if _OF_DAY.fullmatch(first) else _DATED
    if not text.str.fullmatch(form.pattern, na=True).all():
        return None
    times: pd.Series[Any]
    if form is _OF_DAY:
        text = text.where(~text.str.fullmatch(r"\d{1,2}:\d{2}", na=False), text + ":00")
        times = pd.to_timedelta(text, errors="coerce")
    else:
        dated = pd.to_datetime(text.str.replace("/", "-"), format="ISO8601", utc=True, errors="coerce")
        times = dated.dt.tz_localize(None)
    return None if (times.isna() & text.notna()).any() else seconds(times)


def is_date(column: pd.Series[Any]) -> bool:
    """Whether a column holds dates or durations."""
    return column.dtype.kind in _KINDS


def seconds(column: pd.Series[Any]) -> NDArray[np.float64]:
    """Dates as seconds since 1970 and durations as seconds, whatever the unit of their integers."""
    integers, per_second = column.astype("int64").to_numpy(), _PER_SECOND[column.dt.unit]
    # whole seconds and the rest apart: 2e18 ns have more digits than a float64
    values = integers // per_second + integers % per_second / per_second
    return np.where(column.isna().to_numpy(), np.nan, values)


__all__ = ["is_date", "is_time", "seconds", "seconds_of_text"]
