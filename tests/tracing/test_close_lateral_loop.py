"""The closed loop of a lateral record, from the flight to the page: a rudder that acts late is traced and taken out."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from airtruth import cli
from airtruth.loop import close_loop
from airtruth.physics.motion import LATERAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.tracing import TraceOptions

CAMPAIGN = Path(__file__).resolve().parents[2] / "data" / "campaigns" / "lateral_late_rudder.toml"
FEW = TraceOptions(model="linear", effects=("rudder_delay", "gyro_lag"), motion=LATERAL.name)

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("close-lateral-loop")]


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    """Three records with a rudder delay of 80 ms."""
    flown = tmp_path_factory.mktemp("lateral") / "late"
    campaign.fly(plan.make(CAMPAIGN, runs=3), flown)
    return close_loop(flown / "logs", "gtm", flown.parent / "out", ("ls",), trace_options=FEW), flown.parent


def test_a_late_rudder_is_taken_out(loop):
    closed, _ = loop
    assert [effect.name for effect in closed.trace.answer.effects] == ["rudder_delay"]
    assert [t.kind for t in closed.treatments] == ["replaced"]
    declared = closed.trace.answer.derivatives.declared  # the flown aircraft is the declared one, and late
    changes = {change.derivative: change for change in closed.changes}
    assert set(changes) == set(LATERAL.parameters)
    for name in ("CYdr", "Clr", "Cnp", "Cnr", "Cndr"):
        assert abs(changes[name].after / declared[name] - 1.0) < 0.1
        assert abs(changes[name].after - declared[name]) < 0.3 * abs(changes[name].before - declared[name])


def test_the_declared_model_with_the_same_inputs_gives_its_own_derivatives(loop):
    """Simulated records have the elevator and the vertical acceleration of the measured ones, which every log needs."""
    changes = {change.derivative: change for change in loop[0].changes}
    for name in ("Clbeta", "Clp", "Clda", "Cnbeta", "Cndr"):
        change = changes[name]
        assert change.runs_compared == 3
        assert change.declared_same_inputs == pytest.approx(change.declared, rel=0.01)
        assert change.corrected_same_inputs == pytest.approx(change.after, rel=0.05)


def test_its_page(loop):
    out = loop[1] / "loop.html"
    shown = CliRunner().invoke(cli.app, ["report", str(loop[1] / "out"), "--out", str(out)])
    assert shown.exit_code == 0, shown.output
    page = out.read_text(encoding="utf-8")
    assert "rudder_delay" in page
    assert "Cndr" in page
