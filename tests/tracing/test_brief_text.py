"""The short text of a trace: one screen whatever the answer holds, the result first."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from airtruth.cli import app
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.brief import MOST_LINES, as_brief_text
from airtruth.tracing.presentation.text import as_trace_text, verdict

SAMPLE = json.loads((Path(__file__).parents[1] / "reporting" / "trace_sample.json").read_text())
ANSWER = TraceAnswer.from_dict(SAMPLE)
NOTES = st.lists(st.text("abcdefgh ", min_size=3, max_size=500), max_size=12)


def test_the_result_comes_first_and_the_way_to_the_rest_last():
    lines = as_brief_text(ANSWER).splitlines()
    assert " ".join(lines[:2]) == verdict(ANSWER)
    assert lines[-1] == "All tables: --verbose, `airtruth report DIR`, or in Python `result.details()`."
    assert any(line.startswith("gyro_lag: tau_s = ") for line in lines)
    assert any(line.startswith("q [deg/s]") for line in lines)
    assert any(line.startswith("Updated aircraft: ") for line in lines)
    assert len(lines) < len(as_trace_text(ANSWER).splitlines()) / 2


@settings(max_examples=30)
@given(notes=NOTES, effects=st.integers(0, 5), held=st.booleans())
def test_it_fits_on_one_screen(notes, effects, held):
    own = (ANSWER.effects * 3)[:effects]
    records = ANSWER.records if held else replace(ANSWER.records, held_out=())
    verdict_ = "traced" if effects else "unexplained"
    answer = replace(ANSWER, notes=tuple(notes), effects=own, records=records, verdict=verdict_)
    assert len(as_brief_text(answer).splitlines()) <= MOST_LINES


def test_notes_that_make_it_provisional_come_first_and_the_others_are_counted():
    long = tuple(f"{'a remark of some length ' * 20}{k}" for k in range(6))
    reason = "the evidence is weak, so the answer is provisional"
    text = as_brief_text(replace(ANSWER, notes=(*long, reason)))
    assert f"Note: {reason}." in text
    shown = text.count("Note: a remark")
    assert f"{6 - shown} more notes and all tables: --verbose" in text


@pytest.mark.parametrize("verdict_", ["none", "unexplained"])
def test_without_an_effect_the_foremost_candidates_are_listed(verdict_):
    text = as_brief_text(replace(ANSWER, verdict=verdict_, effects=()))
    listed = text.split("Candidates, by significance:\n")[1].split("\n\n")[0].splitlines()
    assert sum(" score " in line for line in listed) == 3


def test_the_command_prints_every_table_with_verbose(tmp_path, monkeypatch):
    def perform(task, advance):
        task.out.mkdir(parents=True, exist_ok=True)
        task.answer.write_text(json.dumps(SAMPLE))
        return "one screen"

    monkeypatch.setattr("airtruth.api.trace_tasks.perform", perform)
    log = Path(__file__).parents[2] / "data" / "undeclared" / "a.parquet"
    words = ["trace", str(log), "--aircraft", "gtm", "--out", str(tmp_path), "--quiet"]
    assert CliRunner().invoke(app, words).stdout == "one screen\n"
    assert CliRunner().invoke(app, [*words, "--verbose"]).stdout == as_trace_text(ANSWER) + "\n"
