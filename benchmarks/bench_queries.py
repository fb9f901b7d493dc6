"""Time of a query over the runs in moderate gusts: on the logs of a campaign, and on the partitioned copy of docs/queries.md.

    python -m benchmarks.bench_queries [--runs 10000]

Logs have the real format, runs of 5 s at 50 Hz, 11 channels of noise; a quarter of the runs has moderate gusts. Each query
is the median of five in a process that has read the files before.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import tempfile
import time
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

REPEATS: Final = 5
"""Repetitions of a query [-]."""
SAMPLES: Final = 251
"""Samples of a run [-]: 5 s at 50 Hz, both ends."""
SIGMAS_M_S: Final = (0.5, 1.0, 1.8, 3.0)
"""Standard deviations of the vertical gust that the runs have in turn [m/s]."""
PAGE: Final = Path(__file__).resolve().parents[1] / "docs" / "queries.md"
"""Page whose COPY is run."""
ON_LOGS: Final = """
SELECT count(DISTINCT l.run_id), quantile_cont(abs(l.az_m_s2), 0.99)
FROM 'out/*/logs/*.parquet' AS l JOIN 'out/*/plan.parquet' AS p USING (run_id)
WHERE p.sigma_w_m_s BETWEEN 1.2 AND 2.4
"""
"""The query of the partition on the logs themselves."""
ON_TABLES: Final = """
SELECT count(*), avg(p.amplitude_rad) FROM 'out/*/plan.parquet' AS p WHERE p.sigma_w_m_s BETWEEN 1.2 AND 2.4
"""
"""A query of the run table alone."""


def main() -> None:
    """Write a campaign, query it, copy it in partitions and query these."""
    import duckdb

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=10_000)
    runs = parser.parse_args().runs
    blocks = re.findall(r"```sql\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (copy,) = (block for block in blocks if block.startswith("COPY"))
    (on_partition,) = (block for block in blocks if "WHERE gust = 'moderate'" in block)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        _write(Path("out/mixed"), runs)
        logs = sum(p.stat().st_size for p in Path("out").rglob("*.parquet"))
        print(f"{runs} runs, {logs / 1e6:.0f} MB of logs, duckdb {duckdb.__version__}")
        table, whole = _median_s(ON_TABLES), _median_s(ON_LOGS)
        start = time.perf_counter()
        duckdb.sql(copy)
        copying = time.perf_counter() - start
        copied = sum(p.stat().st_size for p in Path("by_gust").rglob("*.parquet"))
        part = _median_s(on_partition)
        assert duckdb.sql(ON_LOGS).fetchall() == duckdb.sql(on_partition).fetchall()
        print(f"run table              {1e3 * table:8.0f} ms")
        print(f"logs, joined with plan {1e3 * whole:8.0f} ms")
        print(f"partitioned copy       {1e3 * part:8.0f} ms   ({whole / part:.1f} times faster)")
        print(f"the copy itself        {1e3 * copying:8.0f} ms, {copied / 1e6:.0f} MB")
        os.chdir("/")


def _median_s(query: str) -> float:
    import duckdb

    times = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        duckdb.sql(query).fetchall()
        times.append(time.perf_counter() - start)
    return statistics.median(times[1:])


def _write(out: Path, runs: int) -> None:
    from airtruth.channels import SIGNALS
    from airtruth.logs import store
    from airtruth.logs.flight_log import FlightLog
    from airtruth.logs.names import chunk_file, ordered_number

    (out / "logs").mkdir(parents=True)
    rng = np.random.default_rng(1)
    names = [name for name in SIGNALS if name not in ("run_id", "t_s")][:11]
    ids = [f"mixed-{ordered_number(k, 6)}" for k in range(runs)]
    chunks = np.arange(runs) // 100
    for chunk in range(int(chunks[-1]) + 1):
        own = tuple(ids[100 * chunk : 100 * (chunk + 1)])
        log = FlightLog(
            metadata={"aircraft": "gtm", "sample_rate_hz": 50},
            run_ids=own,
            offsets=np.arange(len(own) + 1, dtype=np.int64) * SAMPLES,
            t_s=np.tile(np.arange(SAMPLES) / 50.0, len(own)),
            channels={name: rng.normal(size=SAMPLES * len(own)) for name in names},
        )
        store.write_log(out / "logs" / chunk_file(chunk), log)
    plan = pd.DataFrame(
        {"run_id": ids, "chunk": chunks, "amplitude_rad": 0.02, "sigma_w_m_s": np.resize(SIGMAS_M_S, runs)}
    )
    store.write_table(out / "plan.parquet", plan)


if __name__ == "__main__":
    main()
