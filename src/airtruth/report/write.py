"""Tables of one or more campaigns, written in every format (the work of ``airtruth tables``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from airtruth.errors import ConfigurationError, StoreError
from airtruth.logs.atomic import write_text
from airtruth.report import layout, render, tables
from airtruth.report.campaign import Campaign, read_campaign
from airtruth.report.tables import Table, TableSpec


@dataclass(frozen=True)
class WrittenTables:
    """What `write_tables` made.

    Attributes
    ----------
    paths : files in the order in which they were written.
    text : the tables in plain text, and what was skipped and why.
    """

    paths: tuple[Path, ...]
    text: str


def write_tables(
    folders: Sequence[Path], out: Path, specs: Sequence[TableSpec] | None = None
) -> WrittenTables:
    """Write each table whose campaign is among ``folders`` as NAME.md, NAME.csv and NAME.tex.

    A campaign "NAME-..." is a variant of NAME and gives the same tables again, under its own name. A
    campaign with methods that no table shows gives a table of all its methods as well. A table without
    a campaign is skipped, and the text says so.

    Parameters
    ----------
    folders : campaign folders with truth.parquet and estimates.parquet.
    out : folder of the tables, made if need be.
    specs : descriptions of the tables, `tables.TABLES` by default.

    Raises
    ------
    ConfigurationError
        No folder is given, or two campaigns bear one name.
    StoreError, LogError
        See `read_campaign`; or a table cannot be written.
    """
    wanted = tuple(tables.TABLES.values() if specs is None else specs)
    campaigns = _campaigns(folders)
    evaluated = [tables.evaluate(spec, campaign) for spec, campaign in _pairs(wanted, campaigns)]
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(
            f"{out}: cannot be made ({error.strerror}); choose another folder with --out"
        ) from error
    paths, texts = [], []
    for table in evaluated:
        grid = layout.lay_out(table)
        texts.append(render.text(grid))
        for suffix, content in (
            ("md", render.markdown(grid)),
            ("csv", render.csv_text(table)),
            ("tex", render.latex(grid, table.name)),
        ):
            paths.append(out / f"{table.name}.{suffix}")
            write_text(paths[-1], content)
    skipped = list(_skipped(wanted, campaigns, evaluated))
    return WrittenTables(tuple(paths), "\n".join([*texts, *skipped]))


def _campaigns(folders: Sequence[Path]) -> list[Campaign]:
    if not folders:
        raise ConfigurationError("no campaign folder is given; state those that `airtruth fly` wrote")
    found: dict[str, Campaign] = {}
    for folder in folders:
        campaign = read_campaign(folder)
        if campaign.name in found:
            other = found[campaign.name].folder
            raise ConfigurationError(
                f"{folder} and {other} are both campaign {campaign.name!r}; give one of them, or a name of "
                "its own in its campaign.json"
            )
        found[campaign.name] = campaign
    return list(found.values())


def _pairs(specs: Sequence[TableSpec], campaigns: Sequence[Campaign]) -> Iterator[tuple[TableSpec, Campaign]]:
    made = [
        (spec, campaign)
        for spec in specs
        for campaign in campaigns
        if tables.shows(spec, campaign) and not campaign.estimates.keys().isdisjoint(spec.columns)
    ]
    yield from made
    for campaign in campaigns:
        shown = {method for spec, shown_by in made if shown_by is campaign for method in spec.methods}
        if not campaign.estimates.keys() <= shown:
            yield tables.all_methods(campaign), campaign


def _skipped(
    specs: Sequence[TableSpec], campaigns: Sequence[Campaign], made: Sequence[Table]
) -> Iterator[str]:
    for spec in specs:
        if any(table.spec is spec for table in made):
            continue
        fitting = [c for c in campaigns if tables.shows(spec, c)]
        if fitting:
            why = f"no estimate by {', '.join(spec.columns)} in {', '.join(str(c.folder) for c in fitting)}"
        else:
            given = ", ".join(f"{c.name!r} ({c.folder})" for c in campaigns)
            why = f"no campaign {spec.campaign!r} or '{spec.campaign}-...' among {given}"
        yield f"Skipped {spec.name}: {why}.\n"
