"""Pages of results: what each kind of source gives, and what is refused."""

import csv
import io
import subprocess
import sys
from dataclasses import dataclass

import matplotlib.figure
import pandas as pd
import pyarrow.parquet as pq
import pytest
import report_synthetic as synthetic
from typer.testing import CliRunner

from airtruth import cli, style
from airtruth.errors import StoreError
from airtruth.reporting import read_campaign, report
from airtruth.reporting.pages.page import Report, write_files
from airtruth.result import Result


@dataclass(frozen=True)
class FlownResult:
    """The smallest result."""

    runs: int

    def summary(self):
        return f"{self.runs} runs <flown>\nnone failed"

    def to_frame(self):
        return pd.DataFrame({"run": ["r0", "r1"], "airspeed [m/s]": [42.852, None], "ok": [True, False]})

    def to_dict(self):
        return {"runs": self.runs}

    def plot(self):
        figure, axes = style.panels(1, 1, width_in=2.0, height_in=2.0)
        axes[0, 0].plot([0.0, 1.0])
        return figure

    def _repr_html_(self):
        return ""


@pytest.fixture
def light(tmp_path):
    return synthetic.paper_campaign(tmp_path / "light", "light", "table1", synthetic.TABLE_1, 40, 1)


@pytest.mark.slow
def test_a_result_in_memory_gives_summary_figure_and_table(tmp_path):
    result = FlownResult(2)
    assert isinstance(result, Result)
    assert isinstance(result.plot(), matplotlib.figure.Figure)
    page, data, latex = report(result, tmp_path / "new" / "flown.html")
    text = page.read_text()
    assert "<h1>Flown result</h1>" in text
    assert "2 runs &lt;flown&gt;" in text
    assert text.count("data:image/png;base64,") == 1
    assert data.read_text() == "run,airspeed [m/s],ok\nr0,42.852,yes\nr1,,no\n"
    assert r"r0 & 42.85 & yes \\" in latex.read_text()
    (figure,) = report(result, tmp_path / "paper.pdf")
    assert figure.name == "paper-result.pdf"
    assert figure.read_bytes().startswith(b"%PDF")


def test_a_folder_and_the_campaign_read_from_it_give_the_same_page(light, tmp_path):
    first = report(str(light), str(tmp_path / "a.html"))
    second = report(read_campaign(light), tmp_path / "b.html")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]


def test_a_method_is_shown_once(tmp_path):
    """ls alone is in Tables 1 and 2 of the paper: the page shows the first of them."""
    folder = synthetic.paper_campaign(tmp_path / "light", "light", "table1", ("ls",), 20, seed=1)
    page = report(folder, tmp_path / "page.html")[0].read_text()
    assert page.count("<caption>Table ") == 1
    assert "Table 1." in page


def test_methods_outside_the_tables_get_a_table_of_all(tmp_path):
    values = {"frequency": synthetic.draw_paper("table1", ("ls",), 20, seed=1)["ls"]}
    folder = synthetic.write_campaign(
        tmp_path / "mine", synthetic.truth_columns(20), synthetic.estimate_columns(values)
    )
    assert "All methods" in report(folder, tmp_path / "page.html")[0].read_text()


def test_estimates_without_a_truth(light, tmp_path):
    (light / "truth.parquet").unlink()
    of_folder = report(light, tmp_path / "a.html")
    of_file = report(light / "estimates.parquet", tmp_path / "b.html")
    assert [p.read_bytes() for p in of_folder] == [p.read_bytes() for p in of_file]
    assert "iv-reference-regressor" in of_file[0].read_text()
    rows = {row["parameter"]: row for row in csv.DictReader(io.StringIO(of_file[1].read_text()))}
    cmq = pq.read_table(light / "estimates.parquet").to_pandas().query("method == 'ls'")["Cmq"]
    assert float(rows["Cmq"]["ls"]) == pytest.approx(cmq.mean(), rel=1e-14)
    assert float(rows["Cmq"]["ls (standard error)"]) == pytest.approx(cmq.std() / 40**0.5, rel=1e-13)
    assert rows["converged"]["ls"] == "40"
    units = [rows[name]["unit"] for name in ("CLalpha", "CLq", "Cmde", "Cmq", "wn_rad_s", "zeta")]
    assert units == ["1/rad", "-", "1/rad", "-", "rad/s", "-"]
    for label in ("CLalpha [1/rad]", "CLq [-]", "wn [rad/s]"):
        assert label in of_file[0].read_text()
    assert r"$\omega_n$ & rad/s &" in of_file[2].read_text()


@pytest.mark.parametrize("name", ["report.gif", "report", "page.txt"])
def test_a_page_needs_the_name_of_one(light, tmp_path, name):
    with pytest.raises(StoreError, match=r"name it .*\.html"):
        report(light, tmp_path / name)


def test_an_empty_folder_names_the_commands(tmp_path):
    with pytest.raises(StoreError, match=r"nothing to report; expected trace\.json .*airtruth identify"):
        report(tmp_path, tmp_path / "report.html")


def test_a_file_that_holds_no_result_is_refused(tmp_path):
    (tmp_path / "first.toml").write_text('name = "first"')
    with pytest.raises(StoreError, match=r"first\.toml: holds no result; allowed: the folder of a trace"):
        report(tmp_path / "first.toml", tmp_path / "report.html")


def test_text_that_utf_8_cannot_hold_is_written_as_an_escape(tmp_path):
    page, *_ = write_files(Report("a \ud800 b", "", ""), tmp_path / "page.html", "html")
    assert page.read_text() == "a \\ud800 b"


def test_the_command_names_the_files(light, tmp_path):
    out = tmp_path / "page.html"
    ended = CliRunner().invoke(cli.app, ["report", str(light), "--out", str(out)])
    assert ended.exit_code == 0
    assert ended.stdout.split() == [str(out.with_suffix(s)) for s in (".html", ".csv", ".tex")]


def test_the_room_is_imported_without_the_tracer_and_without_figures():
    """`airtruth tables` needs neither; both take seconds to import."""
    code = (
        "import airtruth.reporting, sys; print({'numba', 'matplotlib', 'scipy', 'pandas'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
