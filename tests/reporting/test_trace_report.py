"""What a trace tells people: text, figures, page, and the same figures in every format."""

import csv
import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from report_html import parsed, read_page
from report_synthetic import TABLE_1, paper_campaign
from typer.testing import CliRunner

from airtruth import cli, reporting, style
from airtruth.errors import StoreError
from airtruth.logs.histories import FILE, read_histories
from airtruth.reporting import report
from airtruth.reporting.pages.trace_page import trace_report
from airtruth.result import Result
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.table import MISSING
from airtruth.tracing import TraceAnswer, TraceOptions, trace
from airtruth.tracing.answer import Evidence, ParameterEstimate
from airtruth.tracing.presentation.brief import as_brief_text
from airtruth.tracing.presentation.candidates import candidate_table, probability, ranked
from airtruth.tracing.presentation.charts import scores_chart, trace_chart
from airtruth.tracing.presentation.error_table import error_csv, error_table
from airtruth.tracing.presentation.files import EVIDENCE, write_evidence
from airtruth.tracing.presentation.text import as_trace_text, detectable, effect_line, verdict
from airtruth.tracing.presentation.tolerances import tolerance_table
from airtruth.tracing.stage_errors import Replay

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

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("trace-report")]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("told")
    (folder / "told.toml").write_text(CAMPAIGN)
    campaign.fly(plan.make(folder / "told.toml"), folder / "flown", 1)
    options = TraceOptions(effects=("elevator_delay", "vane_arm", "elevator_asymmetry"))
    traced = folder / "traced"
    return trace(folder / "flown", "gtm", options, traced, draw=reporting.draw_traces), traced


@pytest.fixture
def answer(found):
    return found[0].answer


def test_a_trace_is_a_result(found):
    result, folder = found
    assert isinstance(result, Result)
    assert result.summary() == as_brief_text(result.answer)
    assert result.details() == as_trace_text(result.answer)
    assert result.to_dict() == json.loads((folder / "trace.json").read_text())
    assert result.to_frame()["name"].to_list() == [c.name for c in result.answer.candidates]
    assert len(result.plot().axes) == 9
    picture = io.BytesIO(style.as_png(result.plot()))
    pixels = np.asarray(Image.open(picture).convert("L"))
    assert (pixels[:, [0, 1, -2, -1]] == 255).all(), "text is cut at an edge of the picture"
    assert parsed(result._repr_html_()).open == []


def test_text_states_effect_errors_candidates_and_next_flight(answer):
    text = as_trace_text(answer)
    value = answer.effects[0].parameters["delay_s"].value
    assert f"elevator_delay: delay_s = {value:.4f} +-" in text
    for words in (
        "Traced: the declared aircraft lacks elevator_delay.",
        "Free run, held-out records",
        "Candidates",
    ):
        assert words in text
    assert answer.next_flight.split()[0] in text
    assert max(len(line) for line in text.splitlines()) <= 130


def test_the_updated_aircraft_of_no_effect_is_beside_the_refitted_derivatives(answer):
    stages = {name: stage for name, stage in answer.error.stages.items() if name in ("declared", "before")}
    errors = dict.fromkeys(answer.error.channels, 0.25)
    flown = replace(answer, error=replace(answer.error, stages=stages), replay=Replay(errors, errors))
    group = next(g for g in error_table(flown).groups if g.heading.startswith("Flown again in JSBSim"))
    assert all(len([cell for cell in row if cell is not MISSING]) == 4 for row in group.rows)


def test_the_reason_of_a_provisional_answer_is_on_the_first_screen(answer):
    reason = "in JSBSim the updated aircraft is worse, so the answer is provisional"
    many = tuple(f"note {number} of a record that says nothing of the answer" for number in range(12))
    text = as_brief_text(replace(answer, provisional=True, notes=(*many, reason)))
    assert reason in " ".join(text.split())


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"verdict": "none", "effects": ()}, "None: the declared aircraft explains these records"),
        ({"verdict": "none", "effects": ()}, " for a missing effect; "),
        ({"verdict": "none", "effects": ()}, " for the declared model); they show no missing effect."),
        ({"verdict": "unexplained", "effects": ()}, "Unexplained: the declared aircraft lacks something"),
        (
            {"verdict": "unexplained", "effects": (), "remaining": Evidence(12.0, 3e-3, "the derivatives")},
            "lacks something (p = 0.003",
        ),
        ({"verdict": "one_of"}, "One of several: the declared aircraft lacks elevator_delay, or an effect"),
        (
            {"provisional": True, "remaining": Evidence(50.0, 1e-4, "q")},
            "Provisional: a significant anomaly remains",
        ),
    ],
)
def test_verdict_in_one_sentence(answer, changes, sentence):
    changed = replace(answer, **changes)
    if changed.verdict == "one_of":
        alike = replace(answer.effects[0], indistinguishable_from=("actuator_lag",))
        changed = replace(changed, effects=(alike,))
        assert "actuator_lag" in verdict(changed)
    assert sentence in verdict(changed)
    assert sentence in " ".join(as_trace_text(changed).split())


@pytest.mark.parametrize(
    ("coefficients", "words"),
    [
        (("Cm",), "lacks an increment of Cm over alpha_rad, which no effect of the library describes"),
        (
            ("CL", "Cm"),
            "lacks an increment of CL over alpha_rad and an increment of Cm over alpha_rad, which no effect",
        ),
    ],
)
def test_learned_increments_are_listed(answer, coefficients, words):
    learned = tuple(
        replace(
            answer.effects[0], name="increment", variant=f"{c} over alpha_rad", acts_on=c, over="alpha_rad"
        )
        for c in coefficients
    )
    assert words in verdict(replace(answer, verdict="learned", effects=learned))


def test_provisional_without_held_out_says_so(answer):
    alone = replace(answer, provisional=True, records=replace(answer.records, held_out=()))
    assert verdict(alone).endswith("Provisional: no record was held out.")


def test_provisional_without_an_anomaly_refers_to_the_notes(answer):
    calm = replace(answer, provisional=True, remaining=replace(answer.remaining, p_value=0.4))
    assert verdict(calm).endswith("Provisional: the notes state the reason.")


def test_effect_line_names_the_unit_and_takes_an_open_end(answer):
    limit = {"bandwidth_hz": ParameterEstimate(5.0, 0.25, (4.5, None))}
    effect = replace(answer.effects[0], name="actuator_lag", parameters=limit)
    assert effect_line(effect) == "actuator_lag: bandwidth_hz = 5.00 +- 0.25 Hz (95 %: 4.50 to -)"


def test_an_accepted_effect_leads_the_candidates_with_its_gain(answer):
    """However low its score: it may be accepted on its refit."""
    own = next(c for c in answer.candidates if c.name == "elevator_delay")
    others = tuple(c for c in answer.candidates if c is not own)
    changed = replace(answer, candidates=(*others, replace(own, z=0.1, p_value=1.0, p_value_alone=0.9)))
    (first, *_) = ranked(changed)
    assert (first.candidate.key, first.outcome) == ("elevator_delay", "accepted")
    assert first.gain == answer.effects[0].gain_2_log_likelihood
    line = next(line for line in as_trace_text(changed).splitlines() if line.startswith("  elevator_delay"))
    assert "accepted; its refit gains" in line
    (panel,) = scores_chart(changed).panels
    assert panel.rows[0] == "elevator_delay"
    assert panel.bars[0].words.startswith("accepted: refit gains")
    assert candidate_table(changed).rows[0][0] == "elevator_delay"


def test_a_probability_that_underflows_is_a_bound():
    assert probability(0.0) == "p < 1e-300"
    assert probability(0.0123) == "p = 0.012"


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"provisional": None}, "provisional"),
        ({"effects": [{"name": "x"}]}, r"effects\.0\.parameters: field required"),
        ({"candidates": 3}, "candidates"),
    ],
)
def test_a_damaged_answer_names_the_key(answer, changes, where):
    with pytest.raises(StoreError, match=rf"trace\.json: is not a complete answer of a trace \({where}"):
        TraceAnswer.from_dict(answer.to_dict() | changes, "trace.json")


def test_error_table_is_in_degrees_and_csv_in_si(answer):
    """1 rad is 180/pi degrees; the CSV holds the very floats of trace.json."""
    grid = error_table(answer)
    row = next(r for r in grid.groups[0].rows if r[0] == "alpha [deg]")
    rms = answer.error.stages["after"].held_out.free_run["alpha_rad"]
    assert float(row[grid.columns.index("after")]) == pytest.approx(rms * 180.0 / np.pi, rel=5e-3)
    rows = list(csv.DictReader(io.StringIO(error_csv(answer))))
    stored = answer.to_dict()
    for r in rows:
        if r["kind"] == "replay":
            stated = stored["replay"][r["stage"]][r["channel"]]
        else:
            stated = stored["error"][r["stage"]][r["records"]][r["kind"]][r["channel"]]
        assert float(r["rms"]) == stated
    stages = {"declared", "before", "after", "floor"} | ({"control"} & stored["error"].keys())
    assert {r["stage"] for r in rows if r["kind"] != "replay"} == stages
    assert sum(r["kind"] != "replay" for r in rows) == len(stages) * 2 * 2 * 3


def test_replay_is_told_where_there_is_one(answer):
    answer = replace(answer, replay=Replay({"q_rad_s": 0.02}, {"q_rad_s": 0.01}))
    grid = error_table(answer)
    row = next(r for r in grid.groups[-1].rows if r[0] == "q [deg/s]")
    assert str(row[grid.columns.index("declared")]) == "1.15"
    assert str(row[grid.columns.index("after")]) == "0.573"
    assert "held_out,replay,q_rad_s,updated,0.01" in error_csv(answer)
    alone = replace(answer, records=replace(answer.records, held_out=()))
    assert "fit,replay,q_rad_s,updated,0.01" in error_csv(alone)


def test_free_runs_stand_beside_their_tolerances(answer):
    """14 CFR Part 60, Table A2A, 2.c.10: 1.5 deg pitch or 2 deg/s pitch rate, and 0.10 g."""
    grid = tolerance_table(answer)
    assert [g.heading.rpartition(", ")[2] for g in grid.groups] == ["held-out records", "fitted records"]
    rows = {r[0]: dict(zip(grid.columns, r, strict=True)) for r in grid.groups[0].rows}
    assert [str(rows[n]["tolerance"]) for n in ("pitch [deg]", "q [deg/s]", "az [g]")] == [
        "1.5",
        "2.0",
        "0.10",
    ]
    stated = answer.tolerances.stages["after"].held_out
    for name, key, unit in (
        ("pitch [deg]", "pitch_rad", np.pi / 180.0),
        ("q [deg/s]", "q_rad_s", np.pi / 180.0),
        ("az [g]", "az_m_s2", 9.80665),
    ):
        assert float(rows[name]["after"]) == pytest.approx(stated.distances[key] / unit, rel=5e-3)
    assert rows["records within"]["tolerance"] == 1
    assert rows["records within"]["after"] == stated.records_within
    for told in (as_trace_text(answer), trace_report(answer).page, trace_report(answer).latex):
        assert "14 CFR Part 60, Appendix A, Table A2A, test 2.c.10" in " ".join(told.split())
    answer = replace(answer, tolerances=None)
    assert tolerance_table(answer) is None
    assert "14 CFR" not in as_trace_text(answer) + trace_report(answer).page


def test_detectable_names_units(answer):
    assert any(re.fullmatch(r"elevator_delay \d\S* s", line) for line in detectable(answer))


def test_files_are_written_whole(found, tmp_path):
    result, folder = found
    written = write_evidence(result.answer, result.histories, tmp_path / "new")
    assert {p.name for p in written} == set(EVIDENCE) == {p.name for p in (tmp_path / "new").iterdir()}
    for name in EVIDENCE:
        assert (tmp_path / "new" / name).read_bytes() == (folder / name).read_bytes()


def test_the_first_page_has_a_link_to_that_of_another_motion(found, tmp_path):
    """The same result serves for both motions."""
    result, _ = found
    folders = (tmp_path, tmp_path / "lateral")
    folders[1].mkdir()
    reporting.draw_traces(dict.fromkeys(folders, result))
    first, second = ((folder / reporting.TRACE_PAGE).read_text() for folder in folders)
    assert 'href="lateral/trace.html"' in first
    assert 'href="lateral/trace.html"' not in second


def test_records_hold_every_stage_of_every_record(found):
    """The root mean squares of trace.json are those of the residuals of the file."""
    result, folder = found
    stored = read_histories(folder / FILE, "trace again")
    names = result.answer.records
    assert [r.run_id for r in stored.records] == [*names.fitted, *names.held_out]
    assert stored.first.run_id in names.held_out
    assert stored.models == ("declared", "before", "after")
    for group, key in (("fitted", "fit"), ("held out", "held_out")):
        own = [r for r in stored.records if r.group == group]
        for model in stored.models:
            stated = result.answer.error.stages[model].on(key).free_run
            for channel, rms in stated.items():
                pooled = np.sqrt(np.mean([r.rms(model, channel) ** 2 for r in own]))
                assert pooled == pytest.approx(rms, rel=1e-9)
    assert all(r.effect and r.innovations and r.floor for r in stored.records)
    assert {"airtruth", "elevator_delay"}.isdisjoint(stored.facts["provenance"]["digests"])
    assert "aircraft.toml" in stored.facts["provenance"]["digests"]


def test_the_residual_of_the_declared_model_comes_first(found):
    chart = trace_chart(found[0].answer, found[0].histories)
    assert [p.title for p in chart.panels[:3]] == [
        "residual as declared",
        "the effect: surface",
        "residual after",
    ]
    record = found[0].histories.first
    drawn = np.array(chart.panels[0].lines[0].y)
    np.testing.assert_allclose(np.deg2rad(drawn), record.residual("declared", "alpha_rad"), rtol=1e-12)
    assert [line.label for line in chart.panels[2].lines] == ["before", "after"]
    assert chart.panels[0].y_limits == chart.panels[2].y_limits


def test_scores_draw_every_testable_candidate(answer):
    (panel,) = scores_chart(answer).panels
    assert sorted(panel.rows) == ["elevator_asymmetry", "elevator_delay", "vane_arm"]


def test_page_of_a_trace_stands_alone(found, tmp_path):
    _, folder = found
    out = tmp_path / "page" / "report.html"
    assert [p.name for p in report(folder, out)] == ["report.html", "report.csv", "report.tex"]
    page = read_page(out)
    assert page.links == []
    assert (
        set(page.anchors)
        == {"records", "frequency", "errors", "derivatives", "candidates", "innovations", "next", "origin"}
        == set(page.targets)
    )
    assert out.with_suffix(".csv").read_text() == error_csv(TraceAnswer.read(folder / "trace.json"))
    assert r"\begin{tabular}" in out.with_suffix(".tex").read_text()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_figures_for_papers(found, tmp_path, kind):
    files = report(found[1], tmp_path / f"paper.{kind}")
    names = ["trace", "shifts", "scores", "innovations"]
    assert [p.name for p in files] == [f"paper-{name}.{kind}" for name in names]
    starts = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    assert all(p.read_bytes().startswith(starts[kind]) for p in files)


def test_command_names_the_files_it_wrote(found, tmp_path):
    out = tmp_path / "page.html"
    ended = CliRunner().invoke(cli.app, ["report", str(found[1]), "--out", str(out)])
    assert ended.exit_code == 0
    assert ended.stdout.split() == [str(out.with_suffix(s)) for s in (".html", ".csv", ".tex")]


def test_page_escapes_what_records_are_called(answer):
    records = replace(answer.records, fitted=("<script>alert(1)</script>",))
    assert "alert(1)" in trace_report(replace(answer, records=records)).page
    assert "<script>alert" not in trace_report(replace(answer, records=records)).page


def test_page_of_a_campaign_and_of_estimates(tmp_path):
    folder = paper_campaign(tmp_path / "light", "light", "table1", TABLE_1, 40, 1)
    report(folder, tmp_path / "campaign.html")
    page = (tmp_path / "campaign.html").read_text()
    assert "iv-lowpass" in page
    assert "Cmalpha" in page
    assert read_page(tmp_path / "campaign.html").links == []
    assert (tmp_path / "campaign.csv").read_text().startswith("table,campaign,parameter")
    report(folder / "estimates.parquet", tmp_path / "estimates.html")
    assert "iv-lowpass" in (tmp_path / "estimates.html").read_text()


def test_what_cannot_be_reported(tmp_path):
    with pytest.raises(StoreError, match=r"nothing to report; expected trace\.json"):
        report(tmp_path, tmp_path / "report.html")
    with pytest.raises(StoreError, match=r"name it report\.html"):
        report(tmp_path, tmp_path / "report.gif")
    (tmp_path / "trace.json").write_text("{")
    for source in (tmp_path, tmp_path / "trace.json"):  # a trace by its folder or by its file
        with pytest.raises(StoreError, match="airtruth trace"):
            report(source, tmp_path / "report.html")
