"""Pages of a lateral answer beside a longitudinal one: names, units and channels are those of the motion; files of both."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth import reporting
from airtruth.logs.histories import FILE, Histories, History, read_histories, write_histories
from airtruth.physics.motion import LATERAL
from airtruth.physics.proof_of_lateral import TOLERANCES
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate
from airtruth.tracing.answer import ANSWER, DeclaredModel, Derivatives, DerivativeShift, TraceAnswer
from airtruth.tracing.presentation.brief import MOST_LINES, as_brief_text
from airtruth.tracing.presentation.charts import trace_charts
from airtruth.tracing.presentation.match_figure import columns_of, match_figure
from airtruth.tracing.presentation.several import by_motion, html_under_headings, under_headings
from airtruth.tracing.presentation.text import as_trace_text
from airtruth.tracing.presentation.tolerances import tolerance_table
from airtruth.tracing.stage_errors import BySet, Errors, Excursions, Rms, Tolerances

SAMPLE = json.loads((Path(__file__).resolve().parents[1] / "reporting" / "trace_sample.json").read_text())
CHANNELS = LATERAL.output_channels
STAGES = ("declared", "before", "after")
RUDDER_LATE = AcceptedEffect(
    "rudder_delay", {"delay_s": ParameterEstimate(0.081, 0.002, (0.077, 0.085))}, 1e-9, 7.0
)


def lateral_answer() -> TraceAnswer:
    """An answer of the lateral motion, its figures made up."""
    sample = TraceAnswer.from_dict(SAMPLE)
    names = LATERAL.parameters
    rows = {
        stage: {name: 0.1 + 0.01 * k + 0.001 * i for k, name in enumerate(names)}
        for i, stage in enumerate(STAGES)
    }

    def rms(x: float) -> Rms:
        return Rms(dict.fromkeys(CHANNELS, x), dict.fromkeys(CHANNELS, 0.5 * x))

    shown = {s: BySet(rms(0.03 - 0.01 * i), rms(0.03 - 0.01 * i)) for i, s in enumerate(STAGES)}
    far = Excursions({"p_rad_s": 0.05, "r_rad_s": 0.02}, 0.9, 1, 2)
    modes = {s: dict.fromkeys(TOLERANCES, 1.0 + 0.4 * i) for i, s in enumerate(STAGES)}
    shifts = {n: DerivativeShift(0.1, 0.01, 0.12, 0.005, (0.11, 0.13), -0.2 * k) for k, n in enumerate(names)}
    declared = DeclaredModel(False, 50.0, 15, 1e-6, shifts)
    return replace(
        sample,
        verdict="traced",
        effects=(RUDDER_LATE,),
        error=Errors(dict.fromkeys(CHANNELS, 0.2), shown | {"floor": BySet(rms(0.009), rms(0.009))}),
        derivatives=Derivatives(rows["declared"], rows["before"], rows["after"], dict.fromkeys(names, 0.005)),
        tolerances=Tolerances(
            "14 CFR", {"p_rad_s": 0.035, "r_rad_s": 0.035}, {s: BySet(far, far) for s in STAGES}, modes
        ),
        declared_model=declared,
        replay=None,
        axial_force=None,
        updated_aircraft=None,
        credit={},
        refined={},
    )


def lateral_histories() -> Histories:
    t = 0.02 * np.arange(300)
    wave = {c: 0.1 * np.sin((2.0 + k) * t) for k, c in enumerate(CHANNELS)}
    controls = {"aileron_rad": np.where((t > 1) & (t < 2), 0.05, 0.0), "rudder_rad": 0.0 * t}
    models = {s: {c: x * (0.7 + 0.1 * i) for c, x in wave.items()} for i, s in enumerate(STAGES)}

    def one(name: str, group: str) -> History:
        return History(
            name,
            group,
            t,
            controls,
            wave,
            models,
            innovations={s: {c: np.cos(9.0 * t) for c in CHANNELS} for s in STAGES},
            effect={c: 0.2 * x for c, x in wave.items()},
            floor=dict.fromkeys(CHANNELS, 0.01),
            conditions={"airspeed_m_s": 42.85, "trim_rudder_rad": 0.01, "inertia_xx_kg_m2": 1.65},
        )

    return Histories((one("r1", "fitted"), one("r2", "held out")), STAGES, "r2", 2)


@pytest.fixture(scope="module")
def answer() -> TraceAnswer:
    return lateral_answer()


def test_the_answer_states_its_motion_and_comes_back_from_json(answer):
    assert answer.motion is LATERAL
    again = TraceAnswer.from_dict(json.loads(answer.to_json()))
    assert again.tolerances == answer.tolerances
    assert again.to_dict() == answer.to_dict()


def test_the_screen_has_the_channels_and_derivatives_of_the_motion(answer):
    text = as_brief_text(answer)
    assert len(text.splitlines()) <= MOST_LINES
    for words in ("rudder_delay: delay_s = 0.0810", "beta [deg]", "p [deg/s]", "phi [deg]", "ay [m/s2]"):
        assert words in text
    rows = [
        line.split()[0]
        for line in text.partition("Derivatives")[2].splitlines()
        if line.startswith(("CY", "Cl", "Cn"))
    ]
    assert rows == [
        "Cldr",
        "Cnbeta",
        "Cnp",
        "Cnr",
        "Cnda",
        "Cndr",
    ]  # of 15, those farthest from the declaration
    full = as_trace_text(answer)
    assert "rates as p b/(2V), r b/(2V)" in full
    assert "Cnbeta" in full
    assert "Cmalpha" not in full.partition("Candidates")[0].partition("Derivatives")[2]
    assert max(map(len, full.splitlines())) < 130


def test_modes_stand_beside_their_tolerances(answer):
    table = tolerance_table(answer)
    assert table is not None
    rows = {str(row[0]): row for group in table.groups for row in group.rows}
    assert str(rows["p [deg/s]"][1]) == "2.0 or 10 %"
    assert str(rows["Dutch roll, period [s]"][1]) == "0.50 or 10 %"
    # the last stage is the reference, of which each quantity is within
    assert rows["quantities within"][-1] == len(TOLERANCES)
    assert rows["quantities within"][2] < len(TOLERANCES)
    assert any("roll and rudder response" in note for note in table.notes)


def test_every_chart_draws(answer):
    from airtruth.charts import as_figure

    histories = lateral_histories()
    charts = trace_charts(answer, histories)
    assert [c.name for c in charts] == ["trace", "shifts", "scores", "innovations"]
    assert len(charts[0].panels) == 3 * len(CHANNELS)
    for chart in charts:
        as_figure(chart)
    assert columns_of(histories.first) == [("p_rad_s", "aileron_rad"), ("r_rad_s", "rudder_rad")]
    labels = [ax.get_ylabel() for ax in match_figure(histories).axes]
    assert "roll rate [deg/s]" in labels
    assert "rudder\n[deg]" in labels


def test_records_keep_both_controls(tmp_path):
    histories = lateral_histories()
    write_histories(tmp_path / FILE, histories)
    read = read_histories(tmp_path / FILE, "write it again")
    assert list(read.first.controls_rad) == ["aileron_rad", "rudder_rad"]
    np.testing.assert_array_equal(
        read.first.controls_rad["aileron_rad"], histories.first.controls_rad["aileron_rad"]
    )


def test_answers_of_two_motions_stand_under_their_headings(answer):
    both = [TraceAnswer.from_dict(SAMPLE), answer]
    assert list(by_motion(both)) == ["longitudinal", "lateral"]
    assert by_motion(both[:1]) == both[0].to_dict()
    text = under_headings(as_brief_text, both)
    assert text.index("Longitudinal motion") < text.index("Lateral-directional motion")
    assert under_headings(as_brief_text, both[1:]) == as_brief_text(answer)
    assert "<h2>Lateral-directional motion</h2>" in html_under_headings(lambda a: a.verdict, both)


def test_a_folder_of_two_motions_has_a_page_for_each(tmp_path, answer):
    folder = tmp_path / "trace"
    (folder / "lateral").mkdir(parents=True)
    (folder / ANSWER).write_text(json.dumps(SAMPLE))
    (folder / "lateral" / ANSWER).write_text(answer.to_json())
    write_histories(folder / "lateral" / FILE, lateral_histories())
    files = reporting.report(folder, tmp_path / "page.html")
    assert [f.name for f in files] == [
        *("page.html", "page.csv", "page.tex"),
        *("page-lateral.html", "page-lateral.csv", "page-lateral.tex"),
    ]
    first, second = (files[k].read_text(encoding="utf-8") for k in (0, 3))
    assert '<a href="page-lateral.html">' in first
    assert "rudder_delay" in second
    assert "aileron (right less left)/2" in second
    assert '"controls":["aileron","rudder"]' in second
    alone = reporting.report(folder / "lateral", tmp_path / "alone.html")
    assert [f.name for f in alone] == ["alone.html", "alone.csv", "alone.tex"]
