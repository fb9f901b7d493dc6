"""What `make campaign` runs, with a tenth of the runs: it ends in tables and figures, and runs again."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.long
def test_quick_campaign_ends_in_tables_and_figures_and_resumes(tmp_path):
    command = [
        sys.executable,
        "-m",
        "scripts.campaign",
        "--quick",
        "--further",
        "--undeclared",
        "--out",
        str(tmp_path / "out"),
    ]
    first = subprocess.run(command, capture_output=True, text=True, check=False)
    assert first.returncode == 0, first.stderr
    for heading in ("Table 1.", "Table 2.", "Table 3."):
        assert heading in first.stdout
    tables = {p.name for p in (tmp_path / "out" / "tables").iterdir()}
    assert {"table1.md", "table2.csv", "table3.tex", "table1-fit.md", "table3-fit.csv"} <= tables
    figures = {p.name for p in (tmp_path / "out" / "figures").iterdir()}
    assert {
        "flight.png",
        "figure1.png",
        "figure4.png",
        "estimates-light.png",
        "estimates-moderate-fit.png",
    } <= figures
    assert "The loop: effects traced, then in the model" in first.stdout
    assert {p.name for p in (tmp_path / "out" / "loop").iterdir()} >= {
        "loop.md",
        "loop.csv",
        "loop.tex",
        "loop.png",
    }
    assert {p.name for p in (tmp_path / "out" / "trace").iterdir()} >= {"d", "traces.md", "traces.png"}
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "(0 flown now, 0 failed)" in again.stdout
    assert again.stdout.split("Table 1.")[1:] == first.stdout.split("Table 1.")[1:]
