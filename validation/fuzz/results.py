"""Damaged results: trace.json, loop.json, estimates, campaign.json and the manifest."""

from __future__ import annotations

import io
import json
import tempfile
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from airtruth.identification import Options, identify, require_mergeable, settings_of, write_estimates
from airtruth.logs import manifest
from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting import report
from airtruth.simulation.campaign.run import fly
from airtruth.simulation.new_aircraft import estimated_derivatives
from validation.fuzz import logs
from validation.fuzz.mutate import NUMBERS, WORDS, altered, damaged, odd_text

SAMPLE = Path(__file__).resolve().parents[2] / "tests" / "reporting" / "trace_sample.json"
"""A trace of two effects."""


@cache
def trace() -> dict[str, Any]:
    """Content of a trace.json."""
    document: dict[str, Any] = json.loads(SAMPLE.read_text(encoding="utf-8"))
    return document


@cache
def closed_loop() -> dict[str, Any]:
    """Content of a loop.json."""
    rows = [
        {"method": method, "derivative": name, "declared": 1.0, "before": 1.1, "before_error": 0.1, "after": 1.0,
         "after_error": 0.1, "runs_before": 3, "runs_after": 3}
        for method in ("ls", "iv-f1")
        for name in LONGITUDINAL.parameters
    ]  # fmt: skip
    treatments = [{"effect": "elevator_delay", "kind": "replaced", "sentence": "the elevator is delayed"}]
    return {"trace": trace(), "treatments": treatments, "estimates": rows}


@cache
def campaign() -> dict[str, bytes]:
    """Files of a flown and identified campaign."""
    with tempfile.TemporaryDirectory(prefix="airtruth-fuzz-") as folder:
        file = Path(folder, "c.toml")
        file.write_text(logs.CAMPAIGN, encoding="utf-8")
        out = Path(folder, "out")
        fly(file, out, jobs=1)
        write_estimates(out / "estimates.parquet", identify(out, logs.plane(), ("ls", "iv-f1")))
        return {p.name: p.read_bytes() for p in out.iterdir() if p.is_file()}


def damaged_json(rng: Random, document: dict[str, Any]) -> bytes:
    """A document with other entries, or its text with other bytes."""
    text = json.dumps(document, indent=1)
    if rng.random() < 0.25:
        return odd_text(rng, text)
    return json.dumps(altered(rng, document), default=str).encode()


def trace_case(rng: Random, folder: Path) -> None:
    """Damage trace.json and report it."""
    (folder / "trace.json").write_bytes(damaged_json(rng, trace()))
    report(folder, folder / "page.html")


def loop_case(rng: Random, folder: Path) -> None:
    """Damage loop.json and report it."""
    (folder / "loop.json").write_bytes(damaged_json(rng, closed_loop()))
    report(folder, folder / "page.html")


def lay_out(folder: Path) -> None:
    """Write the files of a flown and identified campaign."""
    for name, content in campaign().items():
        (folder / name).write_bytes(content)


def damaged_table(rng: Random, name: str) -> bytes:
    """A table of the campaign with damaged bytes, or with other cells, columns or metadata."""
    content = campaign()[name]
    return damaged(rng, content) if rng.random() < 0.4 else _cells(rng, content)


def use_table(path: Path, rng: Random) -> None:
    """Report a table, report its campaign, merge estimates into it, or build an aircraft from it."""
    kind = rng.randrange(4)
    if kind == 0:
        report(path, path.with_name("page.html"))
    elif kind == 1:
        report(path.parent, path.with_name("page.html"))
    elif kind == 2:
        settings = settings_of(logs.plane(), Options(), False)
        require_mergeable(path, ("ls",), settings, force=rng.random() < 0.3)
        write_estimates(path, _estimates(), force=rng.random() < 0.3)
    else:
        estimated_derivatives(path, rng.choice((None, "ls")))


def estimates_case(rng: Random, folder: Path) -> None:
    """Damage the estimates or the truth of a campaign and use them."""
    lay_out(folder)
    name = rng.choice(("estimates.parquet", "estimates.parquet", "truth.parquet"))
    (folder / name).write_bytes(damaged_table(rng, name))
    use_table(folder / name, rng)


@cache
def _estimates() -> Any:
    return identify(logs.base(), logs.plane(), ("ls",))


def _cells(rng: Random, content: bytes) -> bytes:
    table = pq.read_table(io.BytesIO(content))
    for _ in range(rng.choice((1, 1, 2))):
        column = rng.randrange(table.num_columns)
        name = table.column_names[column]
        values = table.column(column).to_pylist()
        kind = rng.randrange(7)
        if kind == 0:
            table = table.drop_columns([name])
        elif kind == 1:
            table = table.append_column(name, table.column(column))
        elif kind == 2:
            table = table.slice(0, rng.randrange(table.num_rows + 1))
        elif kind == 3:
            table = table.set_column(column, name, pa.array([str(v) for v in values]))
        elif kind == 4:
            table = table.set_column(column, name, pa.array([[v] for v in values]))
        else:
            new = rng.choice((*map(float, NUMBERS), *WORDS, None, True))
            values = [new if rng.random() < 0.5 else v for v in values]
            try:
                table = table.set_column(column, name, pa.array(values))
            except (pa.ArrowException, TypeError):
                table = table.set_column(
                    column, name, pa.array([None if v is None else str(v) for v in values])
                )
        if not table.num_columns:
            break
    facts = dict(table.schema.metadata or {})
    if b"airtruth" in facts and rng.random() < 0.3:
        facts[b"airtruth"] = json.dumps(altered(rng, json.loads(facts[b"airtruth"])), default=str).encode()
    out = io.BytesIO()
    pq.write_table(table.replace_schema_metadata(facts), out)
    return out.getvalue()


def description_case(rng: Random, folder: Path) -> None:
    """Damage campaign.json and report the campaign."""
    lay_out(folder)
    (folder / "campaign.json").write_bytes(damaged_json(rng, json.loads(campaign()["campaign.json"])))
    report(folder, folder / "page.html")


def manifest_case(rng: Random, folder: Path) -> None:
    """Damage the manifest and read it."""
    content = campaign()["manifest.jsonl"]
    lines = content.splitlines()
    path = folder / "manifest.jsonl"
    if rng.random() < 0.5:
        at = rng.randrange(len(lines))
        lines[at] = json.dumps(altered(rng, json.loads(lines[at])), default=str).encode()
        path.write_bytes(b"\n".join([*lines, b""]))
    else:
        path.write_bytes(odd_text(rng, content.decode()))
    manifest.read(path)


def warm(folder: Path) -> None:
    """Every result is reported as it is."""
    (folder / "trace.json").write_text(json.dumps(trace()), encoding="utf-8")
    report(folder, folder / "page.html")
    (folder / "loop.json").write_text(json.dumps(closed_loop()), encoding="utf-8")
    report(folder, folder / "page.html")
    (folder / "c").mkdir(exist_ok=True)
    lay_out(folder / "c")
    report(folder / "c", folder / "page.html")
    _estimates()


__all__ = [
    "closed_loop",
    "damaged_json",
    "damaged_table",
    "description_case",
    "estimates_case",
    "lay_out",
    "loop_case",
    "manifest_case",
    "trace",
    "trace_case",
    "use_table",
    "warm",
]
