"""Charts of a trace: headings state the result, axes their units, and words repeat what colours say."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth.charts import Mark
from airtruth.tracing.accepted import AcceptedEffect, IncrementTable
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.charts import chart_of_shifts, scores_chart
from airtruth.tracing.presentation.effect_panel import learned_panel
from airtruth.tracing.presentation.files import mark_provisional
from airtruth.tracing.presentation.text import headline

SAMPLE = json.loads((Path(__file__).resolve().parents[1] / "reporting" / "trace_sample.json").read_text())


@pytest.fixture
def answer():
    return replace(TraceAnswer.from_dict(SAMPLE), provisional=False)


def test_the_heading_states_the_verdict(answer):
    effect = answer.effects[0]
    alone = replace(answer, verdict="traced", effects=(replace(effect, indistinguishable_from=()),))
    assert headline(alone) == f"Traced: {effect.key}"
    assert headline(replace(alone, provisional=True)) == f"Traced: {effect.key} (provisional)"
    tied = replace(alone, verdict="one_of", effects=(replace(effect, indistinguishable_from=("gyro_lag",)),))
    assert headline(tied) == f"One of several: {effect.key} or gyro_lag"
    assert headline(replace(alone, verdict="none", effects=())) == "No missing effect"
    assert headline(replace(alone, verdict="unexplained", effects=())) == "Unexplained residual"
    assert scores_chart(alone).title.startswith(f"Traced: {effect.key}. ")


def test_words_name_the_accepted_effect_and_those_that_look_the_same(answer):
    effect = answer.effects[0]
    other = next(c.name for c in answer.candidates if c.testable and c.name != effect.name)
    tied = replace(answer, effects=(replace(effect, indistinguishable_from=(other,)),))
    (panel,) = scores_chart(tied).panels
    words = {panel.rows[int(bar.row)]: bar.words for bar in panel.bars}
    assert words[effect.key].startswith("accepted")
    assert words[other] == "looks the same"
    assert set(words.values()) - {words[effect.key], words[other]} <= {""}


def test_the_heading_of_the_shifts_names_those_beyond_two_standard_deviations():
    names = ("CLalpha", "CLq")
    marks = (Mark(0, 1.9), Mark(0.3, -2.1), Mark(1, 2.0))
    assert ": CLalpha beyond two" in chart_of_shifts(names, marks, "").title
    assert ": all within two" in chart_of_shifts(names, marks[:1], "").title


@pytest.mark.parametrize(
    ("acts_on", "by", "label", "factor"),
    [
        ("Cm", None, "increment of Cm [-]", 1.0),
        ("Cm", "elevator_rad", "increment of Cm by elevator_rad [1/rad]", 1.0),
        ("Cm", "q_hat", "increment of Cm by q_hat [-]", 1.0),
        ("alpha_rad", None, "increment of alpha [deg]", 180.0 / np.pi),
        ("az_m_s2", None, "increment of az [m/s2]", 1.0),
        ("az_m_s2", "elevator_rad", "increment of az_m_s2 by elevator_rad [m/s2/rad]", 1.0),
    ],
)
def test_a_learned_increment_has_the_unit_of_what_it_changes(acts_on, by, label, factor):
    table = IncrementTable((0.0, 0.1), (0.0, 0.02), (0.0, 0.01), (0.0, 0.03), (5, 4), 0.0)
    effect = AcceptedEffect(
        "increment", "", {}, 1e-9, 9.0, acts_on=acts_on, over="alpha_rad", by=by, table=table
    )
    panel = learned_panel(effect, table)
    assert (panel.x_label, panel.y_label) == ("alpha [deg]", label)
    np.testing.assert_allclose(panel.lines[0].y, np.multiply(factor, table.value), rtol=1e-12)


def test_the_updated_aircraft_of_a_provisional_answer_says_so(answer, tmp_path):
    stated = replace(answer, updated_aircraft=str(tmp_path), notes=("the records differ",))
    assert mark_provisional(replace(stated, provisional=False)) is None
    assert mark_provisional(replace(stated, provisional=True, updated_aircraft=None)) is None
    assert not list(tmp_path.iterdir())
    file = mark_provisional(replace(stated, provisional=True))
    text = file.read_text()
    assert file == tmp_path / "provisional.txt"
    assert "Provisional:" in text
    assert text.endswith("the records differ.\n")
