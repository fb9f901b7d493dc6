"""Tables as files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from airtruth.logs.atomic import make_folder, write_text
from airtruth.table.data import as_csv
from airtruth.table.latex import as_latex
from airtruth.table.model import Table
from airtruth.table.text import as_markdown


def write_table(
    table: Table,
    folder: Path,
    name: str,
    figures: Table | None = None,
    symbols: Mapping[str, str] | None = None,
) -> tuple[Path, Path, Path]:
    """Write NAME.md, NAME.csv and NAME.tex, each whole or not at all.

    Parameters
    ----------
    table : what Markdown and LaTeX show.
    folder : created if it does not exist.
    name : name of the files, and label of the LaTeX table.
    figures : the same figures in long form for the CSV file; ``table`` itself by default.
    symbols : see `as_latex`.

    Returns
    -------
    The three files.

    Raises
    ------
    StoreError
        If the folder or a file cannot be written.
    """
    make_folder(folder)
    markdown, data, latex = (folder / f"{name}.{suffix}" for suffix in ("md", "csv", "tex"))
    write_text(markdown, as_markdown(table))
    write_text(data, as_csv(table if figures is None else figures))
    write_text(latex, as_latex(table, name, symbols))
    return markdown, data, latex
