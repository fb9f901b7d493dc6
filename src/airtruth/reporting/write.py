"""The paper's tables of one or more campaigns as files (``airtruth tables``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from airtruth.errors import ConfigurationError
from airtruth.reporting.campaign import Parted
from airtruth.reporting.paper import layout, tables
from airtruth.reporting.paper.tables import PaperTable, TableSpec
from airtruth.reporting.stored_campaign import open_campaigns
from airtruth.reporting.symbols import SYMBOLS
from airtruth.table import as_text, write_table


@dataclass(frozen=True)
class WrittenTables:
    """Result of `write_tables`.

    Attributes
    ----------
    paths : files in the order in which they were written.
    text : tables in plain text, and the reason for each table that was skipped.
    """

    paths: tuple[Path, ...]
    text: str


def write_tables(
    folders: Sequence[Path], out: Path, specs: Sequence[TableSpec] | None = None
) -> WrittenTables:
    """Write each table whose campaign is among ``folders`` as NAME.md, NAME.csv and NAME.tex.

    A campaign "NAME-..." is a variant of NAME and gives the same tables under its own name. A campaign with
    methods that no table shows gives a table of all its methods as well, and so does each motion of which a
    folder holds estimates. A table without a campaign is skipped, and the text states the reason.

    Parameters
    ----------
    folders : campaign folders with truth.parquet, and estimates.parquet or estimates-lateral.parquet.
    out : folder of the tables; created if it does not exist.
    specs : descriptions of the tables, `tables.TABLES` by default.

    Raises
    ------
    ConfigurationError
        No folder is given, or two campaigns have the same name.
    StoreError, LogError
        See `airtruth.reporting.campaign.read_campaign`; or a table cannot be written.
    """
    wanted = tuple(tables.TABLES.values() if specs is None else specs)
    campaigns = _campaigns(folders)
    known = {(c.name, c.motion.name): tables.statistics_of(c) for c in campaigns}
    evaluated = [
        tables.evaluate(spec, c, known[c.name, c.motion.name]) for spec, c in _pairs(wanted, campaigns)
    ]
    paths: list[Path] = []
    texts = []
    for table in evaluated:
        shown = layout.lay_out(table)
        texts.append(as_text(shown))
        paths += write_table(shown, out, table.name, tables.long_form(table), SYMBOLS)
    skipped = list(_skipped(wanted, campaigns, evaluated))
    return WrittenTables(tuple(paths), "\n".join([*texts, *skipped]))


def _campaigns(folders: Sequence[Path]) -> list[Parted]:
    if not folders:
        raise ConfigurationError("no campaign folder is given; name folders that `airtruth fly` wrote")
    by_name: dict[str, Path] = {}
    campaigns: list[Parted] = []
    for folder in folders:
        own = open_campaigns(folder)
        name = own[0].name
        if name in by_name:
            raise ConfigurationError(
                f"{folder} and {by_name[name]} are both campaign {name!r}; give one of them, or change "
                "the name in one campaign.json"
            )
        by_name[name] = folder
        campaigns += own
    return campaigns


def _pairs(specs: Sequence[TableSpec], campaigns: Sequence[Parted]) -> Iterator[tuple[TableSpec, Parted]]:
    pairs = [
        (spec, campaign)
        for spec in specs
        for campaign in campaigns
        if tables.shows(spec, campaign) and not set(campaign.methods).isdisjoint(spec.columns)
    ]
    yield from pairs
    for campaign in campaigns:
        shown = {method for spec, shown_by in pairs if shown_by is campaign for method in spec.methods}
        if not shown.issuperset(campaign.methods):
            yield tables.all_methods(campaign), campaign


def _skipped(
    specs: Sequence[TableSpec], campaigns: Sequence[Parted], written: Sequence[PaperTable]
) -> Iterator[str]:
    for spec in specs:
        own = [c for c in campaigns if c.motion is spec.motion]
        if not own or any(table.spec is spec for table in written):
            continue
        fitting = [c for c in own if tables.shows(spec, c)]
        if fitting:
            why = f"no estimate by {', '.join(spec.columns)} in {', '.join(str(c.folder) for c in fitting)}"
        else:
            given = ", ".join(f"{c.name!r} ({c.folder})" for c in own)
            why = f"no campaign {spec.campaign!r} or '{spec.campaign}-...' among {given}"
        yield f"Skipped {spec.name}: {why}.\n"
