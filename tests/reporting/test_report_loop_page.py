"""The page of a closed loop from its folder, and what a damaged loop.json gives."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_damage import BYTES, DELETE, EXAMPLES, VALUES, changed, flipped, page_or_error, paths

from airtruth.physics.motion import LONGITUDINAL
from airtruth.reporting import report

TRACE = json.loads((Path(__file__).parent / "trace_sample.json").read_text())
SAMPLE = {
    "trace": TRACE,
    "treatments": [{"effect": "gyro_lag", "kind": "undone", "sentence": "gyro_lag: the lag of q is undone"}],
    "estimates": [
        {
            "method": method,
            "derivative": name,
            "declared": -1.0,
            "before": -0.9,
            "before_error": 0.02,
            "after": None if name == "CLq" else -0.99,
            "after_error": 0.01,
            "runs_before": 6,
            "runs_after": 5,
            "declared_same_inputs": -0.95,
            "corrected_same_inputs": None if name == "CLq" else -0.98,
            "difference": -0.04,
            "difference_error": 0.01,
            "remaining": -0.01,
            "remaining_error": 0.01,
            "runs_compared": 5,
        }
        for method in ("ls", "iv-f1")
        for name in LONGITUDINAL.parameters
    ],
}
PATHS = [p for p in sorted(paths(SAMPLE), key=str) if p[0] != "trace"]  # the trace has a test of its own


def test_the_page_states_verdict_treatments_and_every_derivative(tmp_path):
    (tmp_path / "loop.json").write_text(json.dumps(SAMPLE))
    page, data, latex = report(tmp_path, tmp_path / "page.html")
    text = page.read_text()
    assert 'class="verdict"' in text
    assert "gyro_lag: the lag of q is undone." in text
    for name in LONGITUDINAL.parameters:
        assert f">{name}</th>" in text
    assert text.count("-0.9000 \u00b1 0.020") == len(LONGITUDINAL.parameters) * 2
    assert (
        text.count("-0.0400 [-0.0678, -0.0122]") == len(LONGITUDINAL.parameters) * 2
    )  # t of 4 degrees of freedom is 2.776
    assert "CLalpha by ls (-0.040, refit -0.030), iv-f1 (-0.040, refit -0.030); CLq" in text
    rows = data.read_text().splitlines()
    assert rows[0].startswith("method,derivative,declared,before,before_error,after")
    assert rows[1] == "ls,CLalpha,-1.0,-0.9,0.02,-0.99,0.01,6,5,-0.95,-0.98,-0.04,0.01,-0.01,0.01,5"
    assert len(rows) == 1 + 2 * len(LONGITUDINAL.parameters)
    assert r"\toprule" in latex.read_text()


@pytest.mark.parametrize("text", ["[]", "{}", "[" * 100_000, "9" * 5000, '{"trace": {}}'])
def test_something_else_is_refused(tmp_path, text):
    (tmp_path / "loop.json").write_text(text)
    assert not page_or_error(tmp_path, tmp_path)


@pytest.mark.slow
@EXAMPLES
@given(at=st.sampled_from(PATHS), value=st.one_of(st.just(DELETE), VALUES))
def test_an_entry_is_wrong(tmp_path, at, value):
    (tmp_path / "loop.json").write_text(json.dumps(changed(SAMPLE, at, value)))
    page_or_error(tmp_path, tmp_path)


@EXAMPLES
@given(damage=BYTES)
def test_bytes_are_wrong(tmp_path, damage):
    (tmp_path / "loop.json").write_bytes(flipped(json.dumps(SAMPLE).encode(), damage))
    page_or_error(tmp_path, tmp_path)
