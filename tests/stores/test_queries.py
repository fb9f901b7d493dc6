"""Every query of docs/queries.md runs, and its numbers are those of pandas."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from airtruth.identification import identify, write_estimates
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign.run import fly

duckdb = pytest.importorskip("duckdb")
pytest.importorskip("polars")

PAGE = Path(__file__).resolve().parents[2] / "docs" / "queries.md"
BLOCKS = re.findall(r"```(sql|python)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
CAMPAIGN = """
schema = 1
name = "{level}"
aircraft = "gtm"
runs = 9
seed = 2
duration_s = 3.0
[condition]
eas_kt = {{ choose = [75.0, 75.0, 75.0, 20.0] }}
altitude_ft = 7000.0
[[manoeuvre]]
kind = "doublet"
amplitude_deg = 1.0
[gust]
figures = "gtm"
level = "{level}"
"""


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two campaigns, with runs at an airspeed at which the GTM cannot be trimmed."""
    folder = tmp_path_factory.mktemp("queries")
    for level in ("light", "moderate"):
        file, out = folder / f"{level}.toml", folder / "out" / level
        file.write_text(CAMPAIGN.format(level=level))
        fly(plan.make(file), out)
        write_estimates(out / "estimates.parquet", identify(out, "gtm", ["ls", "iv-f1"]))
    return folder


def run(number: int, language: str, text: str, values: dict[str, Any]) -> Any:
    if language == "sql":
        result = duckdb.sql(text)
        return None if result is None else result.df()
    exec(compile(text, f"block {number}", "exec"), values)
    return None


@pytest.fixture(scope="module")
def results(campaigns: Path) -> dict[int, Any]:
    """Result of each block by its number: a frame of SQL, the variables of Python."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(campaigns)
        made = {}
        for number, (language, text) in enumerate(BLOCKS):
            values: dict[str, Any] = {}
            frame = run(number, language, text, values)
            made[number] = values if language == "python" else frame
        return made


def block(words: str) -> int:
    (number,) = (k for k, (_, text) in enumerate(BLOCKS) if words in text)
    return number


def test_the_page_has_queries() -> None:
    assert sum(language == "sql" for language, _ in BLOCKS) >= 8
    assert sum(language == "python" for language, _ in BLOCKS) >= 3


@pytest.mark.slow
def test_every_query_gives_rows(results: dict[int, Any]) -> None:
    assert len(results) == len(BLOCKS) > 0
    for number, result in results.items():
        assert result is None or len(result), BLOCKS[number][1]


@pytest.mark.slow
def test_bias_is_that_of_pandas(campaigns: Path, results: dict[int, Any]) -> None:
    out = campaigns / "out" / "light"
    both = pd.read_parquet(out / "estimates.parquet").merge(
        pd.read_parquet(out / "truth.parquet")[["run_id", "Cmalpha"]], on="run_id", suffixes=("", "_true")
    )
    both = both[both["converged"]]
    expected = (both["Cmalpha"] - both["Cmalpha_true"]).groupby(both["method"]).mean()
    by_sql = results[block("AS bias, stddev_samp")].set_index("method")["bias"]
    by_polars = results[block("agg(runs=pl.len()")]["bias"].to_dict(as_series=False)
    np.testing.assert_allclose(by_sql.loc[expected.index], expected, rtol=1e-12)
    assert by_polars["method"] == list(expected.index)
    np.testing.assert_allclose(by_polars["bias"], expected, rtol=1e-12)


@pytest.mark.slow
def test_failed_runs_are_those_of_the_truth(campaigns: Path, results: dict[int, Any]) -> None:
    truth = pd.concat(pd.read_parquet(p) for p in sorted((campaigns / "out").glob("*/truth.parquet")))
    failed = results[block("json_each(line.json -> 'failed')")]
    assert list(failed["run_id"]) == sorted(truth.loc[truth["status"] == "failed", "run_id"])
    assert len(failed)
    assert failed["reason"].str.startswith("gtm cannot be trimmed").all()


@pytest.mark.slow
def test_the_partition_holds_the_runs_in_moderate_gusts(campaigns: Path, results: dict[int, Any]) -> None:
    truth = pd.concat(pd.read_parquet(p) for p in (campaigns / "out").glob("*/truth.parquet"))
    own = truth[(truth["status"] == "ok") & truth["sigma_w_m_s"].between(1.2, 2.4, inclusive="left")]
    assert 0 < len(own) < (truth["status"] == "ok").sum()
    assert results[block("WHERE gust = 'moderate'")]["runs"].item() == len(own)
    moderate = results[block("hive_partitioning=True")]["moderate"]
    assert moderate["run_id"].item() == len(own)


@pytest.mark.slow
def test_one_run_is_read_in_order(results: dict[int, Any]) -> None:
    samples = results[block("WHERE run_id = 'light-000007'")]
    assert len(samples) == 151
    assert samples["t_s"].is_monotonic_increasing
