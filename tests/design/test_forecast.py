"""Standard errors to expect of a campaign, before it is flown."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from airtruth import cli
from airtruth.design import forecast
from airtruth.errors import ConfigurationError
from airtruth.result import Result
from airtruth.simulation.campaign import plan

LIGHT = Path(__file__).resolve().parents[2] / "data" / "campaigns" / "light.toml"


@pytest.fixture(scope="module")
def made():
    return plan.make(LIGHT)


def test_the_bound_is_that_of_the_linear_experiment(made):
    """GTM, 5 s, doublet of 1 deg, light: the bound of tests/identify's linear record at the GTM's rounded figures.

    .1003 6.937 .1324 .0219 1.627 .0377 by `experiment_bound` on that record; trim, mass and the tables'
    slopes differ by a few percent.
    """
    found = forecast(made)
    np.testing.assert_allclose(found.single, [0.1003, 6.937, 0.1324, 0.0219, 1.627, 0.0377], rtol=0.04)
    assert found.kinds == 1
    np.testing.assert_allclose(found.together, found.single / np.sqrt(300.0), rtol=1e-9)


def test_airspeed_sharpens_lift_and_records_add_up(made):
    constant, measured = forecast(made, records=4), forecast(made, records=4, pressure="measured")
    assert (measured.single[:3] < 0.6 * constant.single[:3]).all()
    assert (measured.single <= constant.single).all()
    np.testing.assert_allclose(constant.together, constant.single / 2.0, rtol=1e-9)


def test_kinds_of_runs_are_weighed_by_their_number(made, tmp_path):
    """Two amplitudes in turn: information, that of the strong one four times that of the weak, is averaged."""
    text = LIGHT.read_text().replace("runs = 300", "runs = 4").replace("duration_s = 5.0", "duration_s = 3.0")
    text += '\n[[manoeuvre]]\nkind = "doublet"\namplitude_deg = 0.5\nstart_s = 1.0\nstep_s = 0.5\n'
    path = tmp_path / "two.toml"
    path.write_text(text)
    found = forecast(path)
    assert found.kinds == 2
    assert found.records == 4
    strong = forecast(plan.make(LIGHT, runs=1))
    assert strong.kinds == 1
    assert (found.together < found.single).all()


def test_every_form_of_the_result_agrees(made):
    result = forecast(made, records=7)
    assert isinstance(result, Result)
    facts = json.loads(json.dumps(result.to_dict()))
    assert facts["records"] == 7
    row = next(r for r in result.table().rows if r[0] == "Cmq")
    frame = result.to_frame().set_index("parameter").loc["Cmq"]
    bars = result.plot().axes[0].containers[0]
    expected = result.single[4]
    assert facts["parameters"]["Cmq"]["std"] == row[2] == frame["std"] == expected
    assert bars[4].get_height() == pytest.approx(100.0 * expected / abs(result.theta[4]))
    assert "Cmq" in result.summary()
    assert "<table" in result._repr_html_()
    alone = replace(result, records=1)
    assert "standard error, 1 record" in alone.table().columns
    (legend,) = alone.plot().legends
    assert [words.get_text() for words in legend.get_texts()] == ["one record", "1 record together"]


def test_unknown_pressure_and_silent_sensors_are_refused(made):
    with pytest.raises(ConfigurationError, match="did you mean 'measured'"):
        forecast(made, pressure="mesured")
    with pytest.raises(ConfigurationError, match=r"sensors\.alpha_rad"):
        forecast(plan.make(LIGHT.parent / "foreign-f16.toml"))


def test_command_line():
    run = CliRunner().invoke(cli.app, ["plan", str(LIGHT), "--records", "10", "--json"])
    assert run.exit_code == 0
    assert set(json.loads(run.stdout)["parameters"]) == {"CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde"}
