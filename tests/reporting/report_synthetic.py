"""Campaign folders with estimates drawn around known means, for the tests of the report."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from airtruth.reporting.paper import published

ESTIMATED = published.ESTIMATED
TRUTH = np.array([published.load().truth[name].value for name in ESTIMATED])
TABLE_1 = (
    "ls",
    "iv-lowpass",
    "iv-reference",
    "iv-reference-regressor",
    "iv-actuator",
    "iv-actuator-regressor",
)
TABLE_3 = ("ls", "iv-lowpass", "iv-f1", "iv-f2")


def run_names(runs):
    return [f"r{i:05d}" for i in range(runs)]


def draw_paper(table, methods, runs, seed):
    """Method -> (runs, 8) normal estimates with the paper's means and standard deviations."""
    rng = np.random.default_rng(seed)
    drawn = {}
    for method in methods:
        column = published.load().tables[table].column(method)
        mean = np.array([column.mean[name].value for name in ESTIMATED])
        std = np.array([column.std[name].value for name in ESTIMATED])
        drawn[method] = mean + std * rng.standard_normal((runs, 8))
    return drawn


def truth_columns(runs, failed=()):
    columns = {"run_id": run_names(runs), "status": ["failed" if i in failed else "ok" for i in range(runs)]}
    for name, value in zip(ESTIMATED, TRUTH, strict=True):
        columns[name] = [np.nan if i in failed else value for i in range(runs)]
    return columns


def estimate_columns(values, failed=(), status=None, half_width=0.1):
    """Rows of estimates.parquet; ``status`` maps (method, run) to a status other than converged."""
    status = status or {}
    runs = {method: len(v) for method, v in values.items()}
    rows = [(m, i) for m, n in runs.items() for i in range(n) if i not in failed]
    columns = {
        "run_id": [f"r{i:05d}" for _, i in rows],
        "method": [m for m, _ in rows],
        "converged": [(m, i) not in status for m, i in rows],
        "iterations": [0 if m == "ls" else 3 + i % 3 for m, i in rows],
        "status": [status.get((m, i), "converged") for m, i in rows],
    }
    for j, name in enumerate(ESTIMATED):
        x = np.array([values[m][i, j] for m, i in rows])
        columns |= {
            name: x,
            f"{name}_std": np.full(len(x), half_width / 1.96),
            f"{name}_lower": x - half_width,
            f"{name}_upper": x + half_width,
        }
    return columns


def write_campaign(folder, truth, estimates, description=None):
    folder.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(truth), folder / "truth.parquet")
    pq.write_table(pa.table(estimates), folder / "estimates.parquet")
    if description is not None:
        (folder / "campaign.json").write_text(json.dumps(description))
    return folder


def paper_campaign(folder, name, table, methods, runs, seed, failed=(), status=None):
    """A campaign whose estimates follow the paper's figures."""
    values = draw_paper(table, methods, runs, seed)
    for (method, run), word in (status or {}).items():
        values[method][run] = np.nan if word == "diverged" else 50.0 * values[method][run]
    description = {"name": name, "title": f"{name} turbulence", "runs": runs, "gust": {"level": name}}
    truth = truth_columns(runs, failed)
    return write_campaign(folder, truth, estimate_columns(values, failed, status), description)
