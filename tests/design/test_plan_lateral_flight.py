"""The lateral flight that determines derivatives: the campaign has both controls in both signs, and wrong names are refused."""

import tomllib

import numpy as np
import pytest

from airtruth.design import lateral_flight
from airtruth.design.lateral_flight import LateralQuestion, plan_lateral, with_input
from airtruth.errors import ConfigurationError
from airtruth.simulation.campaign.file import Campaign
from airtruth.starting import campaign_text
from tests.simulation.fly_campaigns import command

BASE = Campaign.model_validate(tomllib.loads(campaign_text("next", "gtm")))


def test_an_input_moves_ailerons_then_rudder_in_both_signs():
    made = with_input(BASE, "121", (0.4, 0.3), 0.05, 6)
    first, second = made.manoeuvre
    assert (first.control, first.also[0].control) == ("aileron", "rudder")
    assert first.also[0].start == pytest.approx(1.0 + 4 * 0.4 + 1.0)
    assert made.runs == 6
    assert made.duration == pytest.approx(1.0 + 4 * 0.7 + 1.0 + 3.0)
    assert second.amplitude.value == pytest.approx(-first.amplitude.value)


@pytest.mark.slow
def test_the_best_input_has_the_smallest_mean_variance(monkeypatch, tmp_path):
    monkeypatch.setattr(lateral_flight, "PATTERNS", {"121": 4.0})
    monkeypatch.setattr(lateral_flight, "STEPS_S", ((0.25, 0.5), (0.3,)))
    found = plan_lateral(BASE, LateralQuestion(("Cnr", "Clp")), 0.05)
    best, other = (np.array(one.values) for one in found.inputs)
    assert np.all(best < other)
    found.write(tmp_path / "next.toml")
    again = Campaign.model_validate(tomllib.loads((tmp_path / "next.toml").read_text()))
    assert again.manoeuvre[0].also[0].control == "rudder"


def test_wrong_names_are_refused():
    with pytest.raises(ConfigurationError, match="derivative 'Cnq'"):
        LateralQuestion(("Cnq",))
    mixed = command("plan", "--motion", "lateral", "--derivative", "Cmq", "--aircraft", "gtm")
    assert mixed.code == 2
    assert "has no derivative 'Cmq'" in mixed.err
