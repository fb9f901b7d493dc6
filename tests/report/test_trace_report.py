"""What a trace tells people: text, figures, page, and the same figures in every format."""

import copy
import csv
import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from report_synthetic import TABLE_1, paper_campaign
from typer.testing import CliRunner

from airtruth import cli
from airtruth.errors import StoreError
from airtruth.fly import campaign, plan
from airtruth.report import as_trace_text, write_report, write_trace_figures
from airtruth.report.html import trace_report
from airtruth.report.trace_figures import PAGES, scores, sight
from airtruth.report.trace_table import error_csv, error_grid, figures
from airtruth.report.trace_text import detectable, effect_line, verdict
from airtruth.report.trace_tolerances import tolerance_grid
from airtruth.trace import TraceOptions, run

CAMPAIGN = """
schema = 1
name = "told"
aircraft = "gtm"
runs = 4
seed = 5
duration_s = 6.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "doublet"
amplitude_deg = 2.0
[gust]
figures = "gtm"
level = "light"
[[effect]]
name = "elevator_delay"
delay_s = 0.04
"""

pytestmark = pytest.mark.xdist_group("trace-report")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("told")
    (folder / "told.toml").write_text(CAMPAIGN)
    campaign.fly(plan.make(folder / "told.toml"), folder / "flown", 1)
    options = TraceOptions(effects=("elevator_delay", "vane_arm", "elevator_asymmetry"))
    return run([folder / "flown" / "logs"], "gtm", options, folder / "traced"), folder / "traced"


@pytest.fixture
def answer(found):
    return copy.deepcopy(found[0].answer)


def test_text_states_effect_errors_candidates_and_next_flight(answer):
    told = as_trace_text(answer)
    value = answer["effects"][0]["parameters"]["delay_s"]["value"]
    assert f"elevator_delay: delay_s = {value:.4f} +-" in told
    for words in (
        "Traced: the declared aircraft lacks elevator_delay.",
        "Free run, held-out records",
        "Candidates",
    ):
        assert words in told
    assert answer["next_flight"].split()[0] in told
    assert max(len(line) for line in told.splitlines()) <= 130


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"verdict": "none", "effects": []}, "None: the declared aircraft explains these records"),
        ({"verdict": "unexplained", "effects": []}, "Unexplained: something is missing"),
        ({"verdict": "one_of"}, "One of several: the aircraft lacks elevator_delay, or what looks the same"),
        ({"provisional": True}, "Provisional: a significant anomaly remains"),
    ],
)
def test_verdict_in_one_sentence(answer, changes, sentence):
    answer |= changes
    if answer["verdict"] == "one_of":
        answer["effects"][0]["indistinguishable_from"] = ["actuator_lag"]
        assert "actuator_lag" in verdict(answer)
    assert sentence in verdict(answer)
    assert sentence in as_trace_text(answer)


def test_provisional_without_held_out_says_so(answer):
    answer["provisional"] = True
    answer["records"]["held_out"] = []
    assert verdict(answer).endswith("Provisional: no record was held out.")


def test_effect_line_names_the_unit_and_takes_an_open_end(answer):
    effect = answer["effects"][0] | {"name": "actuator_lag"}
    effect["parameters"] = {"bandwidth_hz": {"value": 5.0, "std": 0.25, "ci95": [4.5, None]}}
    assert effect_line(effect) == "actuator_lag: bandwidth_hz = 5.00 +- 0.25 Hz (95 %: 4.50 to -)"


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (0.020522, "0.0205"),
        (1606.3, "1606"),
        (2.45e-109, "2.45e-109"),
        (0.0, "0.00"),
        (float("inf"), "-"),
        (-1.786, "-1.79"),
    ],
)
def test_significant_figures(value, told):
    assert figures(value) == told


def test_error_table_is_in_degrees_and_csv_in_si(answer):
    """1 rad is 180/pi degrees; the CSV holds the very floats of trace.json."""
    grid = error_grid(answer)
    row = next(r for r in grid.groups[0].rows if r[0] == "alpha [deg]")
    rms = answer["error"]["after"]["held_out"]["free_run"]["alpha_rad"]
    assert float(row[grid.header.index("after")]) == pytest.approx(rms * 180.0 / np.pi, rel=5e-3)
    rows = list(csv.DictReader(io.StringIO(error_csv(answer))))
    for r in rows:
        if r["kind"] == "replay":
            stated = answer["replay"][r["stage"]][r["channel"]]
        else:
            stated = answer["error"][r["stage"]][r["records"]][r["kind"]][r["channel"]]
        assert float(r["rms"]) == stated
    stages = {"declared", "before", "after", "floor"} | ({"control"} & answer["error"].keys())
    assert {r["stage"] for r in rows if r["kind"] != "replay"} == stages
    assert sum(r["kind"] != "replay" for r in rows) == len(stages) * 2 * 2 * 3


def test_replay_is_told_where_there_is_one(answer):
    answer["replay"] = {"declared": {"q_rad_s": 0.02}, "updated": {"q_rad_s": 0.01}}
    grid = error_grid(answer)
    row = next(r for r in grid.groups[-1].rows if r[0] == "q [deg/s]")
    assert row[grid.header.index("declared")] == "1.15"
    assert row[grid.header.index("after")] == "0.573"
    assert "held_out,replay,q_rad_s,updated,0.01" in error_csv(answer)


def test_free_runs_stand_beside_their_tolerances(answer):
    """14 CFR Part 60, Table A2A, 2.c.10: 1.5 deg pitch or 2 deg/s pitch rate, and 0.10 g."""
    grid = tolerance_grid(answer)
    assert [g.heading.rpartition(", ")[2] for g in grid.groups] == ["held-out records", "fitted records"]
    rows = {r[0]: dict(zip(grid.header, r, strict=True)) for r in grid.groups[0].rows}
    assert [rows[n]["tolerance"] for n in ("pitch [deg]", "q [deg/s]", "az [g]")] == ["1.5", "2.0", "0.10"]
    stated = answer["tolerances"]["after"]["held_out"]
    for name, key, unit in (
        ("pitch [deg]", "pitch_rad", np.pi / 180.0),
        ("q [deg/s]", "q_rad_s", np.pi / 180.0),
        ("az [g]", "az_m_s2", 9.80665),
    ):
        assert float(rows[name]["after"]) == pytest.approx(stated[key] / unit, rel=5e-3)
    assert rows["records within"]["tolerance"] == "1"
    assert rows["records within"]["after"] == str(stated["records_within"])
    for told in (as_trace_text(answer), trace_report(answer).page, trace_report(answer).latex):
        assert "14 CFR Part 60, Appendix A, Table A2A, test 2.c.10" in " ".join(told.split())
    del answer["tolerances"]
    assert tolerance_grid(answer) is None
    assert "14 CFR" not in as_trace_text(answer) + trace_report(answer).page


def test_detectable_names_units(answer):
    assert any(re.fullmatch(r"elevator_delay \d\S* s", line) for line in detectable(answer))


def test_figures_are_written_whole_with_what_they_draw(found, tmp_path):
    trace, _ = found
    written = write_trace_figures(trace, tmp_path / "new")
    assert {p.name for p in written} == {*PAGES, "record.csv", "error.csv"}
    assert {p.name for p in (tmp_path / "new").iterdir()} == {p.name for p in written}
    assert all((tmp_path / "new" / name).read_bytes().startswith(b"\x89PNG") for name in PAGES)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "new" / "record.csv").read_text())))
    seen = sight(trace)
    assert (
        {r["run_id"] for r in rows}
        == {seen.record.signals.run_id}
        <= set(trace.answer["records"]["held_out"])
    )
    residual = np.array([float(r["q_rad_s_measured"]) - float(r["q_rad_s_free_run_after"]) for r in rows])
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(seen.after.free_run[1], rel=1e-9)


def test_scores_draw_every_testable_candidate(answer):
    figure = scores(answer)
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert sorted(names) == ["elevator_asymmetry", "elevator_delay", "vane_arm"]


class Page(HTMLParser):
    """Tags, and what they refer to."""

    def __init__(self):
        super().__init__()
        self.open, self.images, self.links = [], [], []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if tag == "img":
            self.images.append(values["src"])
        self.links += [v for k, v in attributes if k in ("href", "src") and not v.startswith("data:")]
        if tag not in ("meta", "img", "br"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def read_page(path):
    page = Page()
    page.feed(path.read_text())
    assert page.open == []
    return page


def test_page_of_a_trace_stands_alone(found, tmp_path):
    trace, folder = found
    write_trace_figures(trace, folder)
    out = tmp_path / "page" / "report.html"
    assert [p.name for p in write_report(folder, out)] == ["report.html", "report.csv", "report.tex"]
    page = read_page(out)
    assert page.links == []
    assert len(page.images) == len(PAGES)
    assert out.with_suffix(".csv").read_text() == error_csv(json.loads((folder / "trace.json").read_text()))
    assert r"\begin{tabular}" in out.with_suffix(".tex").read_text()


def test_command_names_the_files_it_wrote(found, tmp_path):
    out = tmp_path / "page.html"
    ended = CliRunner().invoke(cli.app, ["report", str(found[1]), "--out", str(out)])
    assert ended.exit_code == 0
    assert ended.stdout.split() == [str(out.with_suffix(s)) for s in (".html", ".csv", ".tex")]


def test_page_escapes_what_records_are_called(answer):
    answer["records"]["fitted"] = ["<script>alert(1)</script>"]
    assert "<script>" not in trace_report(answer).page


def test_page_of_a_campaign_and_of_estimates(tmp_path):
    folder = paper_campaign(tmp_path / "light", "light", "table1", TABLE_1, 40, 1)
    write_report(folder, tmp_path / "campaign.html")
    page = (tmp_path / "campaign.html").read_text()
    assert "iv-lowpass" in page
    assert "Cmalpha" in page
    assert read_page(tmp_path / "campaign.html").links == []
    assert (tmp_path / "campaign.csv").read_text().startswith("table,campaign,parameter")
    write_report(folder / "estimates.parquet", tmp_path / "estimates.html")
    assert "iv-lowpass" in (tmp_path / "estimates.html").read_text()


def test_what_cannot_be_reported(tmp_path):
    with pytest.raises(StoreError, match=r"nothing to report; expected trace\.json"):
        write_report(tmp_path, tmp_path / "report.html")
    with pytest.raises(StoreError, match=r"name it report\.html"):
        write_report(tmp_path, tmp_path / "report.pdf")
    (tmp_path / "trace.json").write_text("{")
    with pytest.raises(StoreError, match="airtruth trace"):
        write_report(tmp_path, tmp_path / "report.html")
