"""Names of files and runs: of a campaign or aircraft by its file, and numbers whose order as text is their own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from string import ascii_lowercase
from typing import Final

from airtruth.physics.motion import LATERAL, LONGITUDINAL

ESTIMATES: Final[Mapping[str, str]] = {
    LONGITUDINAL.name: "estimates.parquet",
    LATERAL.name: "estimates-lateral.parquet",
}
"""Name of a motion -> name of its file of estimates in a campaign folder."""


def name_of(path: Path) -> str:
    """A name that campaigns and aircraft accept, from that of a file.

    Examples
    --------
    >>> name_of(Path("out/my plan.toml"))
    'my-plan'
    """
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", path.stem).strip("-") or "first"


def ordered_number(number: int, digits: int) -> str:
    """A number as text whose order is that of the numbers: a letter for each digit beyond ``digits`` precedes it.

    With six digits, 999999 is followed by a1000000, and a9999999 by b10000000. Letters follow digits in ASCII.

    Parameters
    ----------
    number : not negative, of at most ``digits`` + 26 digits.
    digits : least number of digits.
    """
    text = f"{number:0{digits}d}"
    longer = len(text) - digits
    return text if longer == 0 else f"{ascii_lowercase[longer - 1]}{text}"


def chunk_file(chunk: int) -> str:
    """Return the name of the files of a chunk; names in the order of text are in the order of the chunks."""
    return f"{ordered_number(chunk, 5)}.parquet"


__all__ = ["ESTIMATES", "chunk_file", "name_of", "ordered_number"]
