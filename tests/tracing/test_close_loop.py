"""The closed loop: estimates before and after the traced effects are taken out, its files, the command."""

import json
from pathlib import Path

import pandas as pd
import pytest
import trace_flights as flights
from typer.testing import CliRunner

from airtruth import cli
from airtruth.loop import LoopResult, close_loop
from airtruth.physics.motion import LONGITUDINAL
from airtruth.result import Result
from airtruth.tracing import TraceOptions

FEW = TraceOptions(model="linear", effects=("elevator_delay", "vane_scale"))

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("close-loop")]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Three records with an elevator delay of 60 ms."""
    return flights.fly(tmp_path_factory.mktemp("loop") / "late", (("elevator_delay", {"delay_s": 0.06}),))


@pytest.fixture(scope="module")
def loop(flown):
    return close_loop(flown, "gtm", flown.parent / "out", ("ls",), trace_options=FEW)


def change_of(loop: LoopResult, derivative: str):
    return next(c for c in loop.changes if c.derivative == derivative)


def test_a_delay_is_taken_out(loop):
    """Cmq and Cmde take up most of a delay; after the loop both are nearer to the aircraft that flew."""
    assert [t.kind for t in loop.treatments] == ["replaced"]
    truth = loop.trace.answer.derivatives.declared  # the flown aircraft is the declared one, and late
    for name in ("Cmq", "Cmde"):
        change = change_of(loop, name)
        assert abs(change.after - truth[name]) < abs(change.before - truth[name])
    assert change_of(loop, "Cmq").runs_after == 3


def test_declared_model_with_the_same_inputs_is_the_reference(loop):
    """A linear declared model without noise: `ls` errs by its central differences and its low-pass filter, which take up most of
    Cmq: 2.1 % here, and at most 1 % of the stiffness and the lift slope.
    """
    for name, share in (("CLalpha", 0.01), ("Cmalpha", 0.01), ("Cmq", 0.03)):
        change = change_of(loop, name)
        assert change.runs_compared == 3
        assert change.declared_same_inputs == pytest.approx(change.declared, rel=share)
    assert "same inputs: the declared and the corrected model" in " ".join(loop.summary().split())


def test_it_is_a_result(loop):
    assert isinstance(loop, Result)
    assert len(loop.to_frame()) == len(LONGITUDINAL.parameters)
    assert "elevator_rad is replaced by the surface that the air sees" in loop.summary()
    assert "<table>" in loop._repr_html_()
    assert len(loop.plot().axes) == len(LONGITUDINAL.parameters)


def test_its_files(loop, flown):
    out = flown.parent / "out"
    names = {
        "estimates-before.parquet",
        "estimates-after.parquet",
        "loop.json",
        "loop.md",
        "loop.csv",
        "loop.tex",
    }
    assert names | {"trace"} == {p.name for p in out.iterdir()}
    assert json.loads((out / "loop.json").read_text()) == loop.to_dict()
    assert (out / "trace" / "trace.json").exists()
    before, after = (pd.read_parquet(out / f"estimates-{stage}.parquet") for stage in ("before", "after"))
    assert before["Cmq"].mean() == pytest.approx(change_of(loop, "Cmq").before, rel=1e-12)
    assert after["Cmq"].mean() == pytest.approx(change_of(loop, "Cmq").after, rel=1e-12)


def test_without_an_effect_after_is_before(flown):
    options = TraceOptions(model="linear", effects=("gust_level",))  # never testable
    loop = close_loop(flown, "gtm", methods=("ls",), trace_options=options)
    assert loop.treatments == ()
    assert all(c.before == c.after for c in loop.changes)
    assert "No effect was accepted" in loop.summary()


def test_the_command(flown, tmp_path):
    words = ["loop", str(flown), "--aircraft", "gtm", "--out", str(tmp_path / "out"), "--model", "linear"]
    words += ["--effect", "elevator_delay", "--method", "ls", "--jobs", "1", "--quiet"]
    ended = CliRunner().invoke(cli.app, words)
    assert ended.exit_code == 0, ended.output
    assert "Derivatives before and after" in ended.stdout
    assert Path(tmp_path / "out" / "loop.json").exists()
