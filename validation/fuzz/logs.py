"""Damaged flight logs."""

from __future__ import annotations

import io
import json
import tempfile
from functools import cache
from pathlib import Path
from random import Random
from typing import Any, Final

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from airtruth.aircraft import Aircraft, load
from airtruth.checks.motions import check_motions
from airtruth.identification import identify
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.sources import named_logs
from airtruth.logs.store import read_log, write_log
from airtruth.simulation.campaign.run import fly
from validation.fuzz.mutate import NUMBERS, WORDS, damaged

METHODS: Final = ("ls", "iv-lowpass", "iv-reference", "iv-f1", "iv-refined", "frequency")
"""Methods by which logs are identified, besides ls two of them in turn."""


CAMPAIGN: Final = """
schema = 1
name = "fuzz"
title = "base of the damaged inputs"
aircraft = "gtm"
runs = 3
seed = 7
duration_s = 4.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
flight_path_deg = { mean = 0.0, std = 0.1 }
[[manoeuvre]]
kind = "doublet"
amplitude_deg = { low = 1.0, high = 1.5 }
start_s = 1.0
step_s = 0.5
[gust]
figures = "gtm"
level = "light"
factor = 0.5
start = "stationary"
"""
"""Campaign of the base log, and base of the damaged campaigns."""


@cache
def base() -> FlightLog:
    """Three runs of 4 s at 50 Hz of the GTM in light gusts."""
    with tempfile.TemporaryDirectory(prefix="airtruth-fuzz-") as folder:
        file = Path(folder, "c.toml")
        file.write_text(CAMPAIGN, encoding="utf-8")
        fly(file, Path(folder, "out"), jobs=1)
        return FlightLog.concat([log for _, log in named_logs(Path(folder, "out"))])


@cache
def plane() -> Aircraft:
    """The aircraft of the logs."""
    return load("gtm")


@cache
def encodings() -> tuple[bytes, ...]:
    """The log as airtruth writes it, and as other programs write it."""
    frame = base().to_frame()
    with tempfile.TemporaryDirectory(prefix="airtruth-fuzz-") as folder:
        write_log(Path(folder, "own.parquet"), base())
        results = [Path(folder, "own.parquet").read_bytes()]
    for options in (
        {"compression": "snappy"},
        {"compression": "gzip", "data_page_version": "2.0", "row_group_size": 100},
        {"compression": "none", "use_dictionary": False, "write_statistics": False},
    ):
        out = io.BytesIO()
        table = pa.Table.from_pandas(frame, preserve_index=False)
        pq.write_table(table, out, **options)
        results.append(out.getvalue())
    return tuple(results)


def warm(folder: Path) -> None:
    """Compile and import whatever the cases use."""
    path = folder / "warm.parquet"
    write_log(path, base())
    use(path, Random(0), every=True)


def use(path: Path, rng: Random, *, every: bool = False) -> None:
    """Read a log; identify and check it."""
    log = read_log(path)
    force = rng.random() < 0.3
    methods = METHODS if every else ("ls", *rng.sample(METHODS[1:], 1))
    identify(log, plane(), methods, force=force)
    if every or rng.random() < 0.2:
        check_motions([(str(path), log)], plane(), force=force)


def damaged_log(rng: Random) -> bytes:
    """A log with damaged bytes, half of the time as airtruth writes it."""
    return damaged(rng, rng.choice(encodings()) if rng.random() < 0.5 else encodings()[0])


def altered_log(rng: Random) -> bytes:
    """A log with other values, columns, types, runs, times or metadata."""
    frame = base().to_frame()
    facts: dict[str, Any] = {"schema": 1, "aircraft": "gtm", "sample_rate_hz": 50}
    with np.errstate(all="ignore"):
        for _ in range(rng.choice((1, 1, 2, 3))):
            frame = _altered(rng, frame, facts)
    text = rng.choice(("{", "[]", "[" * 5000, "null", "\x00")) if rng.random() < 0.03 else json.dumps(facts)
    out = io.BytesIO()
    pq.write_table(_table(rng, frame).replace_schema_metadata({b"airtruth": text.encode()}), out)
    return out.getvalue()


def bytes_case(rng: Random, folder: Path) -> None:
    """Damage bytes of a log; read, identify and check it."""
    (folder / "log.parquet").write_bytes(damaged_log(rng))
    use(folder / "log.parquet", rng)


def contents_case(rng: Random, folder: Path) -> None:
    """Alter the contents of a log; read, identify and check it."""
    (folder / "log.parquet").write_bytes(altered_log(rng))
    use(folder / "log.parquet", rng)


def _altered(rng: Random, frame: pd.DataFrame, facts: dict[str, Any]) -> pd.DataFrame:
    names = [n for n in frame.columns if n != "run_id"]
    name = rng.choice(names) if names else "t_s"
    rows = slice(a := rng.randrange(len(frame) + 1), a + rng.choice((1, 3, 60, 1000)))
    kind = rng.randrange(14)
    if kind < 3:  # a part of a channel
        values = frame[name].to_numpy(dtype=object, copy=True)
        values[rows] = _number(rng)
        frame = frame.assign(**{name: pd.Series(values).infer_objects()})
    elif kind == 3:  # a whole channel
        frame = frame.assign(**{name: _number(rng)})
    elif kind == 4:  # its unit, sign or offset
        factor, offset = (
            rng.choice((-1.0, 57.3, 0.0, 1e-9, 1e9, 1e200, 0.3048)),
            rng.choice((0.0, 0.0, 1e3, 1e17)),
        )
        frame = frame.assign(**{name: pd.to_numeric(frame[name], errors="coerce") * factor + offset})
    elif kind == 5:
        frame = frame.drop(columns=name)
    elif kind == 6:
        frame = frame.rename(
            columns={name: rng.choice((name[:-1], name.upper(), rng.choice(names), *WORDS[:6]))}
        )
        frame = frame.loc[:, ~frame.columns.duplicated()]
    elif kind == 7:  # rows
        frame = rng.choice(
            (frame.iloc[:0], frame.iloc[rows], frame.drop(frame.index[rows]), frame.iloc[::-1], pd.concat([frame, frame]),
             frame.sample(frac=1.0, random_state=rng.randrange(2**31)), frame.iloc[::7], frame.iloc[:21])
        ).reset_index(drop=True)  # fmt: skip
    elif kind == 8:  # runs
        ids = (
            frame["run_id"].to_numpy(dtype=object).copy()
            if "run_id" in frame
            else np.empty(len(frame), object)
        )
        ids[rows] = rng.choice((None, "", "b", "x" * 2000, "\u0000", "é", 7, "../x"))
        frame = frame.assign(run_id=ids)
    elif kind == 9:  # times
        t = frame["t_s"].to_numpy(dtype=float).copy() if "t_s" in frame else np.arange(len(frame)) / 50.0
        t = rng.choice(
            (
                t * rng.choice(NUMBERS),
                t + rng.choice(NUMBERS),
                np.round(t, 1),
                t.astype(np.float32),
                -t,
                t * 0.0,
            )
        )
        frame = frame.assign(t_s=t)
    elif kind == 10:  # types
        to = rng.choice(("float32", "float16", "int64", "str", "bool", "category", "complex"))
        if to != "complex":
            numbers = pd.to_numeric(frame[name], errors="coerce").replace([np.inf, -np.inf, np.nan], 0)
            frame = frame.assign(**{name: numbers.clip(-1e18, 1e18).astype(to)})
    elif kind == 11:
        facts[rng.choice(("sample_rate_hz", "schema", "aircraft", "record_constants", "forced"))] = (
            rng.choice(
                (
                    *[n for n in NUMBERS if not isinstance(n, float) or np.isfinite(n)],
                    None,
                    "50",
                    [1],
                    {"a": {"mass_kg": 1}},
                )
            )
        )
    elif kind == 12:  # noise or silence
        frame = frame.assign(
            **{name: np.random.default_rng(rng.randrange(2**32)).standard_normal(len(frame))}
        )
    else:  # one channel instead of another
        frame = frame.assign(**{name: frame[rng.choice(names)].to_numpy()}) if names else frame
    return frame


def _number(rng: Random) -> float:
    return float(rng.choice(NUMBERS))


def _table(rng: Random, frame: pd.DataFrame) -> pa.Table:
    """The frame as a table, sometimes with a column twice, units that contradict, or no rows of a type."""
    try:
        table = pa.Table.from_pandas(frame, preserve_index=False)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        table = pa.Table.from_pandas(frame.astype(str), preserve_index=False)
    kind = rng.randrange(20)
    if kind == 0 and table.num_columns:
        column = rng.randrange(table.num_columns)
        table = pa.Table.from_arrays(
            [*table.columns, table.column(column)], [*table.column_names, table.column_names[column]]
        )
    elif kind == 1:
        fields = [
            f.with_metadata({"unit": rng.choice(("deg", "m_s", "", "ft", "\u0000"))}) for f in table.schema
        ]
        table = pa.Table.from_arrays(table.columns, schema=pa.schema(fields))
    return table


__all__ = ["altered_log", "base", "bytes_case", "contents_case", "damaged_log", "plane", "use", "warm"]
